"""Local SLAM: predict, register, recover, insert. Its frame drifts; loop closure mends that."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bsmap_cli.geometry.compiled_poses import Pose, as_pose
from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.mapping.compact_clusters import CompactClusters
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.sensor.sight import Sight
from bsmap_cli.slam.following import Followed, Follower
from bsmap_cli.slam.keyframes import Keyframe, is_keyframe
from bsmap_cli.slam.matching import FEWEST_POINTS, match_scan, share_enough
from bsmap_cli.slam.prediction import (
    UNTOLD,
    Cadence,
    Motion,
    moved_on,
    told,
    unknown_motion,
    worst_sigma_m,
)
from bsmap_cli.slam.registration import RegistrationResult
from bsmap_cli.slam.submap import Submap

if TYPE_CHECKING:
    from bsmap_cli.slam.slam_settings import SlamSettings


class Tracked(NamedTuple):
    """What tracking made of one scan: its pose in the local frame, and whether it is a keyframe."""

    pose_local: SE2
    keyframe: Keyframe | None
    lost: bool
    degenerate: bool


@dataclass(slots=True)
class LocalSlam:
    """Tracks against the older of two active submaps and fills both.

    submaps and keyframes only ever grow; a finished submap no longer changes.
    """

    settings: SlamSettings
    sigma_m: float
    submaps: list[Submap] = field(default_factory=list)
    keyframes: list[Keyframe] = field(default_factory=list)
    finished: int = 0
    merge_seconds: float = 0.0
    _pose: SE2 = field(default_factory=SE2.identity)
    _lost_scans: int = 0
    _afresh: bool = False
    _coasted_m: float = 0.0
    _coasted_rad: float = 0.0
    _explained: float = 1.0
    _overlap: float = 0.0
    _cadence: Cadence = field(default_factory=Cadence)
    _motion: Motion = field(init=False)
    _follower: Follower = field(init=False)

    def __post_init__(self) -> None:
        self._motion = unknown_motion(self.settings.prediction, self.settings.ladder[-1])
        self._follower = Follower(self.settings)

    @property
    def last_step(self) -> Pose:
        """Motion of the base between the last two scans, in its own frame."""
        return self._motion.step

    def process(
        self,
        scan_index: int,
        stamp_ns: int,
        clusters: Sequence[Clusters],
        pose_odom_base: SE2 | None,
    ) -> Tracked:
        """Predict, register, recover and, on a keyframe, insert."""
        stretch = self._cadence.observe(stamp_ns)
        odometry = told(pose_odom_base)
        if not self.submaps:
            self._begin_submap()
            self._motion = self._moved((0.0, 0.0, 0.0), odometry, None)
            first = self._insert(scan_index, clusters, None, False)
            return Tracked(self._pose, first, False, False)
        blind = stretch if odometry is UNTOLD else 1.0
        followed = self._follow(clusters, odometry, blind)
        if followed.plain and followed.match:
            match, due, lost = followed.match, followed.due, False
            self._pose, self._motion = followed.pose_local, followed.motion
            self._lost_scans, self._afresh = 0, False
        else:
            match, due, lost = self._find(clusters, odometry, blind, followed)
        seen = lost or match.points >= FEWEST_POINTS
        self._explained = match.inlier_ratio
        self._overlap = max(self._overlap, match.inlier_ratio)
        due = due or match.inlier_ratio < self.settings.keyframes.overlap * self._overlap
        keyframe = None
        if lost and self._afresh and followed.prediction.by_odometry:
            # new ground would hold as little of such scans as this does: they are too sparse
            keyframe = self._insert(scan_index, clusters, None, False) if due else None
        elif self._lost_scans >= self.settings.recovery.patience:
            self._begin_anew()
            keyframe = self._insert(scan_index, clusters, None, True)
            self._lost_scans = 0
        elif seen and not lost and due:
            keyframe = self._insert(scan_index, clusters, match, False)
        return Tracked(self._pose, keyframe, lost, match.degenerate > 0)

    def _follow(self, clusters: Sequence[Clusters], odometry: Pose, blind: float) -> Followed:
        """Expect the scan where the motion leads, and look on the finest level alone."""
        recovery, older = self.settings.recovery, self.older
        enough = math.inf
        if blind <= recovery.gap and len(clusters[-1].points) >= FEWEST_POINTS:
            enough = max(share_enough(self._explained, self.settings), recovery.lost_below)
        return self._follower.follow(
            older.levels[-1],
            clusters[-1],
            self._motion,
            odometry,
            self._cadence.elapsed_s,
            origin=older.pose_local,
            last=self._pose,
            last_keyframe=self.keyframes[-1].pose_local,
            enough=enough,
            sigma_m=self.sigma_m,
        )

    def _find(
        self, clusters: Sequence[Clusters], odometry: Pose, blind: float, followed: Followed
    ) -> tuple[RegistrationResult, bool, bool]:
        """Match a scan that does not lie as expected; whether a keyframe is due, whether lost."""
        older, prediction = self.older, followed.prediction
        match = match_scan(
            older,
            clusters,
            older.to_submap(self._pose),
            prediction,
            blind=blind,
            explained=self._explained,
            finest=followed.match,
            sigma_m=self.sigma_m,
            settings=self.settings,
        )
        seen = match.points >= FEWEST_POINTS
        lost = seen and match.inlier_ratio < self.settings.recovery.lost_below
        if seen and not lost:
            pose = older.pose_local @ SE2.from_array(match.pose)
        else:
            pose = self._pose @ SE2(*prediction.step)
        self._lost_scans = self._lost_scans + 1 if lost else 0
        if match.degenerate or lost or not seen:
            self._coasted_m += prediction.drift_m
        if lost or not seen:
            self._coasted_rad += prediction.drift_rad
        measured = seen and not lost and not match.degenerate
        step = pose.relative_to(self._pose)
        self._motion = self._moved(step, odometry, match.information if measured else None)
        self._pose = pose
        self._afresh = self._afresh and (lost or not seen)
        moved = pose.relative_to(self.keyframes[-1].pose_local)
        return match, is_keyframe(moved, self._follower.keyframe_rule), lost

    def _moved(self, step: Pose, odometry: Pose, information: Points | None) -> Motion:
        """The motion after a step, and the information of the match that measured it."""
        vague_m = 0.0 if information is None else worst_sigma_m(information)
        rule, measured = self._follower.motion_rule, information is not None
        return moved_on(self._motion, as_pose(step), odometry, measured, vague_m, rule)

    @property
    def older(self) -> Submap:
        """The active submap that scans are matched against."""
        return self.submaps[self.finished]

    def _insert(
        self,
        scan_index: int,
        clusters: Sequence[Clusters],
        result: RegistrationResult | None,
        weak: bool,
    ) -> Keyframe:
        """Make a keyframe of the last pose, fill the active submaps and turn them over."""
        keyframe = Keyframe(
            index=len(self.keyframes),
            scan_index=scan_index,
            pose_local=self._pose,
            clusters=CompactClusters.pack(clusters[-1]),
            submap=self.finished,
            information=result.information if result else np.zeros((3, 3)),
            coasted_m=self._coasted_m,
            coasted_rad=self._coasted_rad,
            weak=weak,
            explained=result.inlier_ratio if result else 0.0,
        )
        self.keyframes.append(keyframe)
        self._coasted_m = self._coasted_rad = self._overlap = 0.0
        began = time.perf_counter()
        for submap in self.submaps[self.finished :]:
            submap.insert(keyframe, clusters, self.sigma_m)
        self.merge_seconds += time.perf_counter() - began
        full = self.settings.submaps.keyframes
        if len(self.older.keyframes) >= full and len(self.submaps) > self.finished + 1:
            self.older.finish()
            self.finished += 1
        if len(self.submaps[-1].keyframes) >= full // 2 and len(self.submaps) == self.finished + 1:
            self._begin_submap()
        return keyframe

    def fade(self, keyframe: Keyframe, sight: Sight) -> None:
        """Let the submaps that hold a keyframe lose what it looks through."""
        for submap in self.submaps[-3:]:  # two are filled; a third may just have begun
            if submap.keyframes[-1:] == [keyframe.index]:
                submap.fade(sight, submap.to_submap(keyframe.pose_local), self.sigma_m)

    def _begin_submap(self) -> None:
        self.submaps.append(Submap(len(self.submaps), self._pose, self.settings))

    def _begin_anew(self) -> None:
        """Leave the active submaps as they are and start on new ground."""
        for submap in self.submaps[self.finished :]:
            submap.finish()
        self.finished = len(self.submaps)
        self._begin_submap()
        self._afresh = True
