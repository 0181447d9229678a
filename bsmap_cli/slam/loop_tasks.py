"""What a search for loops is told of tracking: all of it, and nothing that still changes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.compact_clusters import CompactClusters
from bsmap_cli.slam.keyframes import Keyframe
from bsmap_cli.slam.local_slam import LocalSlam
from bsmap_cli.slam.submap import Submap
from bsmap_cli.slam.uncertainty import way_deviation


class Link(NamedTuple):
    """A submap that begins: its pose in the one before, or in the local frame, as tracking has it.

    deviation : what tracking may have lost since the one before began [m], [rad].
    """

    step: SE2
    deviation: tuple[float, float]


class Place(NamedTuple):
    """A keyframe that looks for loops; its submap is the one that it was matched against."""

    keyframe: int
    submap: int
    pose_local: SE2
    pose_submap_base: SE2
    explained: float


class LoopTask(NamedTuple):
    """One keyframe, and what tracking has done since the one before.

    links : of submaps that have begun. finished : submaps that may be searched from now on.
    """

    place: Place
    clusters: CompactClusters
    sigma_m: float
    links: tuple[Link, ...]
    finished: tuple[Submap, ...]


class LoopTasks:
    """Tells each keyframe's task, in their order."""

    def __init__(self, local: LocalSlam) -> None:
        self._local = local
        self._begun = 0
        self._finished = 0

    def task(self, keyframe: Keyframe) -> LoopTask:
        """The task of the keyframe that was made last."""
        submaps = self._local.submaps
        links = tuple(self._link(k) for k in range(self._begun, len(submaps)))
        # the last one that is finished shares keyframes with the one that is tracked on
        finished = tuple(submaps[self._finished : max(0, keyframe.submap - 1)])
        self._begun = len(submaps)
        self._finished += len(finished)
        pose = submaps[keyframe.submap].to_submap(keyframe.pose_local)
        place = Place(
            keyframe.index, keyframe.submap, keyframe.pose_local, pose, keyframe.explained
        )
        return LoopTask(place, keyframe.clusters, self._local.sigma_m, links, finished)

    def _link(self, k: int) -> Link:
        submaps, unit = self._local.submaps, self._local.settings.ladder[-1]
        pose = submaps[k].pose_local
        if k == 0:
            return Link(pose, way_deviation(0.0, unit))
        way = coasted_m = coasted_rad = 0.0
        weak = False
        for before, frame in self._steps(k):
            step = frame.pose_local.relative_to(before.pose_local)
            way += math.hypot(step.x, step.y)
            coasted_m += frame.coasted_m
            coasted_rad += frame.coasted_rad
            weak = weak or frame.weak
        deviation = way_deviation(
            way, unit, coasted_m=coasted_m, coasted_rad=coasted_rad, weak=weak
        )
        return Link(submaps[k - 1].to_submap(pose), deviation)

    def _steps(self, k: int) -> Iterator[tuple[Keyframe, Keyframe]]:
        """Neighbouring keyframes from the beginning of submap k - 1 to that of submap k."""
        submaps, keyframes = self._local.submaps, self._local.keyframes
        before, behind = submaps[k - 1].keyframes, submaps[k].keyframes
        # one begun with the last keyframe stays empty where tracking is lost next
        begin = before[0] if before else behind[0] - 1
        end = behind[0] + 1 if behind else before[-1] + 1
        for index in range(begin + 1, min(end, len(keyframes))):
            yield keyframes[index - 1], keyframes[index]
