"""From scans to a globally consistent map: Sec. IV, loop closure, and Algorithm 1 at the end."""

from __future__ import annotations

import time
from array import array
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.mapping.freeze import freeze_level
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.sight import find_sight
from bsmap_cli.sensor.trajectory import Trajectory
from bsmap_cli.slam.final_map import final_map
from bsmap_cli.slam.front_end import FrontEnd
from bsmap_cli.slam.full_graph import solve_full_graph
from bsmap_cli.slam.keyframes import Keyframe
from bsmap_cli.slam.known_map import KnownMap
from bsmap_cli.slam.local_slam import LocalSlam
from bsmap_cli.slam.loop_closure import LoopCloser
from bsmap_cli.slam.loop_tasks import LoopTask, LoopTasks
from bsmap_cli.slam.loops_beside import LoopsBeside
from bsmap_cli.slam.old_map import OldMap
from bsmap_cli.slam.slam_settings import SlamSettings
from bsmap_cli.slam.slam_view import SlamView, view_of
from bsmap_cli.slam.tracked_map import tracked_levels

TRIES_HERE = 16  # to close a loop: then all that a second process needs is loaded, and of use


@dataclass(frozen=True, slots=True)
class SlamResult:
    """The map, one pose for every scan, and how the run went (keys of the report)."""

    document: MapDocument
    trajectory: Trajectory
    figures: dict[str, Any]


@dataclass(slots=True)
class ScanLog:
    """40 bytes a scan: stamp, keyframe before it, pose in the local frame."""

    stamps_ns: array[int] = field(default_factory=lambda: array("q"))
    keyframes: array[int] = field(default_factory=lambda: array("q"))
    poses: array[float] = field(default_factory=lambda: array("d"))

    def add(self, stamp_ns: int, keyframe: int, pose: SE2) -> None:
        """One scan."""
        self.stamps_ns.append(stamp_ns)
        self.keyframes.append(keyframe)
        self.poses.extend((pose.x, pose.y, pose.theta))


class Slam:
    """Feed scans to `process`, in the order of the log; `finish` closes the map.

    known : a map to go on with, of the degree and the finest knot step of the settings.
    cores : with more than one, loops are looked for in a process beside this one, where that can
    be: the result is the same, but `view` then does not know of them.
    """

    def __init__(
        self, settings: SlamSettings, known: KnownMap | None = None, *, cores: int = 1
    ) -> None:
        self.settings = settings
        self._known = known
        self._log = ScanLog()
        self._front = FrontEnd(settings)
        self._local: LocalSlam | None = None
        self._closer = LoopCloser(settings)
        self._tasks: LoopTasks | None = None
        self._beside: LoopsBeside | None = None
        self._cores = cores
        self._forks = cores > 1
        self._lost: list[dict[str, int]] = []
        self._degenerate = 0
        self._was_lost = False
        self.seconds = {
            "fit": 0.0,
            "register": 0.0,
            "merge": 0.0,
            "loops": 0.0,
            "graph": 0.0,
            "final_map": 0.0,
        }

    def process(self, scan: Scan) -> None:
        """Track one scan, insert it if it is a keyframe, and look for loops."""
        settings = self.settings
        started = time.perf_counter()
        step = self._local.last_step if self._local else (0.0, 0.0, 0.0)
        clusters = self._front.clusters(scan, step)
        if self._local is None:
            self._local = LocalSlam(settings, self._front.sigma_m)
            self._tasks = LoopTasks(self._local)
        local = self._local
        local.sigma_m = self._front.sigma_m
        segmented = time.perf_counter()
        index = len(self._log.stamps_ns)
        tracked = local.process(index, scan.stamp_ns, clusters, scan.pose_odom_base)
        done = time.perf_counter()
        self.seconds["fit"] += segmented - started
        merged = local.merge_seconds - self.seconds["merge"]
        self.seconds["merge"] += merged
        self.seconds["register"] += done - segmented - merged
        self._log.add(scan.stamp_ns, len(local.keyframes) - 1, tracked.pose_local)
        self._degenerate += tracked.degenerate
        self._note_loss(tracked.lost, scan.stamp_ns)
        if tracked.keyframe:
            self._look(scan, tracked.keyframe)
        if tracked.keyframe and settings.loops.enabled and self._tasks:
            self._look_for_loops(self._tasks.task(tracked.keyframe))
            self.seconds["loops"] += time.perf_counter() - done

    def _look_for_loops(self, task: LoopTask) -> None:
        if self._forks and self._closer.tried >= TRIES_HERE:
            self._forks = False
            with suppress(OSError):
                self._beside = LoopsBeside(self._closer)
        (self._beside or self._closer).process(task)

    def _look(self, scan: Scan, keyframe: Keyframe) -> None:
        """Let the map fade where the keyframe looks through it, or remember that for the end."""
        settings, local = self.settings, self._local
        method = settings.visibility.method
        if method == "off" or local is None:
            return
        sight = find_sight(scan, settings.sensor, settings.ladder[-1], self._front.twist)
        if method == "fade":
            local.fade(keyframe, sight)
        if method == "evidence" or settings.final_map.rebuild:
            keyframe.sight = sight

    def _note_loss(self, lost: bool, stamp_ns: int) -> None:
        if lost and not self._was_lost:
            self._lost.append({"stamp_ns": stamp_ns, "scans": 0})
        if lost:
            self._lost[-1]["scans"] += 1
        self._was_lost = lost

    def view(self) -> SlamView | None:
        """How the run stands; None before the first scan."""
        if self._local is None:
            return None
        pose_local = SE2.from_array(self._log.poses[-3:])
        return view_of(self._local, self._closer.graph.poses, pose_local)

    def finish(self) -> SlamResult:
        """Solve for all poses, build the map once more with them, and give every scan its pose.

        Raises
        ------
        TrackingError : there is a map to go on with, and the log has no place in it.
        """
        local, closer, settings = self._local, self._closer, self.settings
        if local is None:
            empty = Trajectory(np.zeros(0, np.int64), np.zeros((0, 3)))
            return SlamResult(
                MapDocument(degree=settings.degree, max_weight=1, levels=()), empty, {}
            )
        started = time.perf_counter()
        if self._beside:
            self._beside.finish()
            self.seconds["loops"] += time.perf_counter() - started
            started = time.perf_counter()
        known = self._known
        if known:
            poses, rejected = OldMap(known, local, closer.loops).solve()
        else:
            poses, rejected = solve_full_graph(local, closer.loops)
        solved = time.perf_counter()
        cap = settings.merging.max_weight
        if settings.final_map.rebuild:
            old = known.frozen if known else ()
            poses, maps = final_map(
                poses, local.keyframes, settings, local.sigma_m, old, cores=self._cores
            )
            levels = tuple(freeze_level(level, max_weight=cap) for level in maps)
        else:
            levels = tracked_levels(local.submaps, local.keyframes, poses, settings, local.sigma_m)
        self.seconds["graph"] += solved - started
        self.seconds["final_map"] += time.perf_counter() - solved
        document = MapDocument(degree=settings.degree, max_weight=cap, levels=levels)
        trajectory = self._trajectory(poses)
        figures = {
            "keyframes": len(local.keyframes),
            "submaps": len(local.submaps),
            "loops": len(closer.loops) - rejected,
            "loops_tried": closer.tried,
            "loops_rejected": rejected,
            "tracking_lost": self._lost,
            "degenerate_share": self._degenerate / max(len(trajectory), 1),
            "travelled_m": float(np.hypot(*np.diff(trajectory.poses[:, :2], axis=0).T).sum()),
        }
        return SlamResult(document, trajectory, figures)

    def _trajectory(self, keyframe_poses: Points) -> Trajectory:
        """Every scan rides on the keyframes before and behind it, the nearer the more."""
        local = self._local
        assert local is not None
        stamps = np.array(self._log.stamps_ns, np.int64)
        tracked = np.array(self._log.poses).reshape(-1, 3)
        before = np.array(self._log.keyframes)
        after = np.minimum(before + 1, len(local.keyframes) - 1)
        index = np.array([frame.scan_index for frame in local.keyframes])
        local_poses = np.array([frame.pose_local.as_array() for frame in local.keyframes])
        ridden = [
            compose(keyframe_poses[k], relative(local_poses[k], tracked)) for k in (before, after)
        ]
        gap = np.maximum(index[after] - index[before], 1)
        share = np.clip((np.arange(len(stamps)) - index[before]) / gap, 0.0, 1.0)[:, None]
        share[after == before] = 0.0
        step = ridden[1] - ridden[0]
        step[:, 2] -= np.pi * 2 * np.floor(step[:, 2] / (np.pi * 2) + 0.5)
        return Trajectory(stamps, ridden[0] + share * step)


def relative(origin: Points, poses: Points) -> Points:
    """(n, 3) poses as seen from (n, 3) origins."""
    cos, sin = np.cos(origin[:, 2]), np.sin(origin[:, 2])
    d = poses - origin
    return np.column_stack((cos * d[:, 0] + sin * d[:, 1], cos * d[:, 1] - sin * d[:, 0], d[:, 2]))


def compose(origin: Points, poses: Points) -> Points:
    """(n, 3) poses given in the frames of (n, 3) origins, in the frame of those."""
    cos, sin = np.cos(origin[:, 2]), np.sin(origin[:, 2])
    x = origin[:, 0] + cos * poses[:, 0] - sin * poses[:, 1]
    y = origin[:, 1] + sin * poses[:, 0] + cos * poses[:, 1]
    return np.column_stack((x, y, origin[:, 2] + poses[:, 2]))
