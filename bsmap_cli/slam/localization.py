"""Where was the robot in a saved map? The start is unknown, and the map stays as it is.

Until the place is found, local SLAM gathers what the robot sees into a small map of its own,
which is searched for in the whole old map, all positions and headings. Where more than one place
fits, the robot moves on and sees more. From then on each scan is matched against the old map; when
that fails, the search begins anew.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bsmap_cli.geometry.compiled_poses import as_pose
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.scan_levels import ScanLevels
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.trajectory import Trajectory
from bsmap_cli.slam.front_end import FrontEnd
from bsmap_cli.slam.keyframes import Keyframe
from bsmap_cli.slam.known_map import KnownMap, settings_for_map
from bsmap_cli.slam.ladder import register_down
from bsmap_cli.slam.likelihood import sample_surfaces
from bsmap_cli.slam.local_slam import LocalSlam
from bsmap_cli.slam.matching import FEWEST_POINTS, match_scan
from bsmap_cli.slam.prediction import (
    UNTOLD,
    Cadence,
    motion_rule,
    moved_on,
    predict,
    told,
    unknown_motion,
    worst_sigma_m,
)
from bsmap_cli.slam.registration import RegistrationResult
from bsmap_cli.slam.slam_settings import SlamSettings
from bsmap_cli.slam.uncertainty import isotropic_information

WITNESSES = 10  # keyframes, the newest ones, that are asked whether they fit a place
AGREEING = 0.75  # of them must
FEWEST_AT_FIRST = 3  # a robot outside of the map may see what looks like a part of it
STRAYED_STEPS, STRAYED_SHARE = 10.0, 0.1  # what a bridge may err: finest knot steps, of its way
EXPECTED_STEPS = 2.0  # from the prediction, a bad match is believed [finest knot steps]
SUSPICIOUS = 0.04  # of a scan's points that fit the map usually, and now do not
MEMORY = 0.02  # share of the newest scan in what is usual
PATIENCE_SHARE = 8  # a search that failed is repeated once this share more has been seen


@dataclass(frozen=True, slots=True)
class Localized:
    """One pose for every scan, in the frame of the map.

    converged_after_scans : how many it took to find the place; None: it never was found.
    lost_scans : after that, those without a place on the map; their poses bridge what lies
    between the last place and the next.
    """

    trajectory: Trajectory
    converged_after_scans: int | None
    lost_scans: int


class Localizer:
    """Feed scans to `process`, in the order of the log; `finish` tells where they were.

    MapFileError where the map draws nothing.
    """

    def __init__(self, document: MapDocument, settings: SlamSettings) -> None:
        self.settings = settings_for_map(settings.without_faint(), document)
        self._map = KnownMap(document, self.settings)
        self._front = FrontEnd(self.settings)
        self._stamps_ns, self._poses = array("q"), array("d")
        self._converged: int | None = None
        self._lost_scans = self._lost_in_a_row = 0
        self._pose = SE2.identity()
        self._usual_ratio = 1.0
        self._cadence = Cadence()
        unit = self.settings.ladder[-1]
        self._motion = unknown_motion(self.settings.prediction, unit)
        self._motion_rule = motion_rule(self.settings.prediction, unit)
        self._begin_seeking()

    def process(self, scan: Scan) -> None:
        """Find or follow the robot by one more scan."""
        step = self._local.last_step if self._local else self._motion.step
        clusters = self._front.clusters(scan, step)
        self._stamps_ns.append(scan.stamp_ns)
        if self._local is None:
            self._follow(scan, clusters)
        else:
            self._seek(self._local, scan, clusters)

    def finish(self) -> Localized:
        """All poses, once the log has ended; then a place that few scans tell of is good enough."""
        if self._local_poses and self._local and self._next_search == FEWEST_AT_FIRST:
            self._find(self._local, self._local_poses[-1])
        if self._converged is None and self._candidate is not None:
            self._settle(*self._candidate)
        poses = np.array(self._poses, np.float64).reshape(-1, 3)
        stamps = np.array(self._stamps_ns, np.int64)
        return Localized(Trajectory(stamps, poses), self._converged, self._lost_scans)

    def _follow(self, scan: Scan, clusters: Sequence[Clusters]) -> None:
        """Track against the map; where that fails for some scans, seek again."""
        stretch = self._cadence.observe(scan.stamp_ns)
        odometry = told(scan.pose_odom_base)
        prediction = predict(self._motion, odometry, self._cadence.elapsed_s, self._motion_rule)
        result = match_scan(
            self._map,
            clusters,
            self._pose,
            prediction,
            blind=stretch if odometry is UNTOLD else 1.0,
            explained=self._usual_ratio,
            growing=False,
            sigma_m=self._front.sigma_m,
            settings=self._wary(),
        )
        seen = result.points >= FEWEST_POINTS
        pose, found = self._pose @ SE2(*prediction.step), SE2.from_array(result.pose)
        lost = seen and not self._credible(result, pose.inverse() @ found)
        if seen and not lost:
            pose = found
            self._usual_ratio += MEMORY * (result.inlier_ratio - self._usual_ratio)
        measured = seen and not lost and not result.degenerate
        step = self._pose.inverse() @ pose
        vague_m = worst_sigma_m(result.information) if measured else 0.0
        self._motion = moved_on(
            self._motion, as_pose(step), odometry, measured, vague_m, self._motion_rule
        )
        self._pose = pose
        self._poses.extend(pose.as_array())
        self._lost_in_a_row = self._lost_in_a_row + 1 if lost else 0
        self._lost_scans += int(lost)
        if self._lost_in_a_row >= self.settings.recovery.patience:
            self._begin_seeking()

    def _credible(self, result: RegistrationResult, gap: SE2) -> bool:
        """Whether a match may be the place, `gap` away from the predicted one.

        At the edge of the map a search finds poses that fit a little better than none: what fits
        badly must lie where the robot was expected.
        """
        recovery, unit = self.settings.recovery, self.settings.ladder[-1]
        if math.hypot(gap.x, gap.y) > EXPECTED_STEPS * unit:
            return result.inlier_ratio >= recovery.search_below
        return result.inlier_ratio >= recovery.lost_below

    def _wary(self) -> SlamSettings:
        """Settings that search as soon as a scan fits the map less well than usual.

        A finished map explains nearly all of a scan: what it does not may tell of a slip along a
        wall. How much that is depends on what has changed since the map was made.
        """
        recovery = self.settings.recovery
        search_below = max(recovery.search_below, self._usual_ratio - SUSPICIOUS)
        gain = min(recovery.gain, 0.5 * SUSPICIOUS)
        return replace(
            self.settings, recovery=replace(recovery, search_below=search_below, gain=gain)
        )

    def _begin_seeking(self) -> None:
        self._local: LocalSlam | None = LocalSlam(self.settings, self._front.sigma_m)
        self._pose_map_local = self._pose  # as far as is known
        self._seen_from = len(self._stamps_ns)
        self._local_poses: list[SE2] = []
        self._next_search = FEWEST_AT_FIRST if self._converged is None else 1
        self._candidate: tuple[SE2, SE2] | None = None

    def _seek(self, local: LocalSlam, scan: Scan, clusters: Sequence[Clusters]) -> None:
        """Go on with the small map; search the old one for it whenever it has grown."""
        self._cadence.observe(scan.stamp_ns)
        local.sigma_m = self._front.sigma_m
        tracked = local.process(
            len(self._stamps_ns) - 1, scan.stamp_ns, clusters, scan.pose_odom_base
        )
        self._local_poses.append(tracked.pose_local)
        self._poses.extend((self._pose_map_local @ tracked.pose_local).as_array())
        self._lost_scans += int(self._converged is not None)
        seen = len(local.keyframes)
        if tracked.keyframe is None or seen < self._next_search:
            return
        self._next_search = seen + max(1, seen // PATIENCE_SHARE)
        pose = self._find(local, tracked.pose_local)
        if pose is not None:
            self._settle(pose, tracked.pose_local)
            odometry = told(scan.pose_odom_base)
            self._motion = moved_on(
                self._motion, local.last_step, odometry, False, 0.0, self._motion_rule
            )

    def _find(self, local: LocalSlam, pose_local: SE2) -> SE2 | None:
        """The base in the map, if one place alone fits all that was seen of late."""
        pose_base_submap = local.older.to_submap(pose_local).inverse()
        spacing_m = 2.0 * self.settings.ladder[-1]
        points, tangents = sample_surfaces(local.older.levels[-1], spacing_m)
        turn = SE2(0.0, 0.0, pose_base_submap.theta)
        peak = self._map.find(
            pose_base_submap.transform(points),
            turn.transform(tangents),
            uniqueness=self.settings.loops.uniqueness,
        )
        if peak is None:
            return None
        pose_map_local = SE2.from_array(peak.pose) @ pose_local.inverse()
        witnesses = [local.keyframes[k] for k in local.older.keyframes[-WITNESSES:]]
        found = [self._placed(keyframe, pose_map_local) for keyframe in witnesses]
        agreeing = sum(pose is not None for pose in found)
        here = found[-1]
        if here is None or agreeing < AGREEING * len(witnesses):
            return None
        self._candidate = here, pose_local
        return here if agreeing >= self._wanted_witnesses(here @ pose_local.inverse()) else None

    def _wanted_witnesses(self, pose_map_local: SE2) -> int:
        """Keyframes that must fit: few where the way from the last place leads there as well."""
        if self._converged is None:
            return FEWEST_AT_FIRST
        steps = np.diff([[pose.x, pose.y] for pose in self._local_poses], axis=0)
        way_m = float(np.hypot(steps[:, 0], steps[:, 1]).sum())
        here = self._local_poses[-1]
        gap = (self._pose_map_local @ here).inverse() @ (pose_map_local @ here)
        allowed_m = STRAYED_STEPS * self.settings.ladder[-1] + STRAYED_SHARE * way_m
        return 1 if math.hypot(gap.x, gap.y) <= allowed_m else WITNESSES

    def _placed(self, keyframe: Keyframe, pose_map_local: SE2) -> SE2 | None:
        """A keyframe's pose on the map near where a search puts it, if it fits there."""
        settings, sigma_m = self.settings, self._front.sigma_m
        unit = settings.ladder[-1]
        finest = keyframe.clusters.unpack(unit, sigma_m)
        start = (pose_map_local @ keyframe.pose_local).as_array()
        result = register_down(
            self._map.levels,
            ScanLevels(finest, settings.ladder, settings.fitting, sigma_m),
            start,
            start,
            isotropic_information((2.0 * unit, 0.1)),
            sigma_m=sigma_m,
            settings=settings.registration,
        )
        fits = (
            result.points >= FEWEST_POINTS
            and result.inlier_ratio >= settings.recovery.search_below
            and result.rms_m <= settings.loops.max_rms * unit
        )
        return SE2.from_array(result.pose) if fits else None

    def _settle(self, pose: SE2, pose_local: SE2) -> None:
        """The place is found: put what was seen since the search began where it belongs.

        After a loss, the scans without a place lead from the last one to the next.
        """
        found = pose @ pose_local.inverse()
        last = len(self._local_poses) - 1
        for k, seen in enumerate(self._local_poses):
            after = (found @ seen).as_array()
            if self._converged is not None and k < last:
                gap = (self._pose_map_local @ seen).inverse() @ SE2.from_array(after)
                share = k / last
                part = SE2(share * gap.x, share * gap.y, share * gap.theta)
                after = (self._pose_map_local @ seen @ part).as_array()
            row = 3 * (self._seen_from + k)
            self._poses[row : row + 3] = array("d", after)
        if self._converged is None:
            self._converged = len(self._stamps_ns)
        self._local = None
        self._pose = pose
        self._lost_in_a_row = 0
