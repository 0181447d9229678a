"""Go on with an old map: where the keyframes of a new log lie on it.

A new log is first mapped on its own. Then stretches of its keyframes are searched for in the whole
old map, all positions and headings; the place that most of them agree on puts the log there. From
then on the keyframes are registered on the old map, those next to what is already placed first,
and the old map becomes one more node of the graph, held fixed.
"""

from __future__ import annotations

import numpy as np

from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.slam.full_graph import Anchor, solve_full_graph
from bsmap_cli.slam.known_map import KnownMap
from bsmap_cli.slam.local_slam import LocalSlam
from bsmap_cli.slam.loop_closure import DIRECT_STEPS, Loop
from bsmap_cli.slam.old_map_search import APART, PlaceFinder
from bsmap_cli.slam.uncertainty import match_information, way_deviation

ROUNDS = 6  # of placing keyframes and solving the graph


class OldMap:
    """Places the keyframes of a finished run on a map that was there before."""

    def __init__(self, known: KnownMap, local: LocalSlam, loops: list[Loop]) -> None:
        self._local, self._loops = local, loops
        self._settings = local.settings
        self._unit = local.settings.ladder[-1]
        self._finder = PlaceFinder(known, local)
        self._anchors: dict[int, Anchor] = {}

    def solve(self) -> tuple[Points, int]:
        """(n, 3) poses of the keyframes in the frame of the old map; loops that proved wrong.

        Raises
        ------
        TrackingError : no place in the old map fits the log, or more than one.
        """
        alone, rejected = solve_full_graph(self._local, self._loops)
        stretch, pose_map_log = self._finder.find(alone)
        poses = np.array([(pose_map_log @ SE2.from_array(pose)).as_array() for pose in alone])
        self._anchor_all(stretch, poses)
        for _ in range(ROUNDS):
            anchors = [self._anchors[k] for k in sorted(self._anchors)]
            poses, rejected = solve_full_graph(
                self._local, self._loops, anchors=anchors, start=poses
            )
            if not self._extend(poses):
                break
        return poses, rejected

    def _anchor_all(self, stretch: range, poses: Points) -> int:
        """Anchor those keyframes of a stretch that fit where (n, 3) `poses` put them; how many."""
        before = len(self._anchors)
        for k in stretch:
            if k in self._anchors:
                continue
            result = self._finder.registered(k, poses[k])
            if self._finder.fits(result):
                information = match_information(result.information, self._unit)
                self._anchors[k] = Anchor(k, SE2.from_array(result.pose), information)
        return len(self._anchors) - before

    def _extend(self, poses: Points) -> int:
        """Place further keyframes, stretch by stretch; how many more hold on to the old map."""
        added = 0
        known_m = self._finder.way_m[sorted(self._anchors)]
        count = len(self._local.keyframes)
        for begin in range(0, count, APART):
            stretch = range(begin, min(begin + APART, count))
            if all(k in self._anchors for k in stretch):
                continue
            reach_m, reach_rad = self._reach(stretch, known_m)
            if reach_m <= DIRECT_STEPS * self._unit:
                added += self._anchor_all(stretch, poses)
                continue
            place = self._finder.place_near(stretch, poses[begin], reach_m, reach_rad)
            if place is not None:
                first = self._local.keyframes[begin].pose_local.inverse()
                moved = poses.copy()
                for k in stretch:
                    step = first @ self._local.keyframes[k].pose_local
                    moved[k] = (place.pose_map_base @ step).as_array()
                added += self._anchor_all(stretch, moved)
        return added

    def _reach(self, stretch: range, known_m: Vector) -> tuple[float, float]:
        """How far from where the graph puts it a stretch may lie [m], [rad].

        known_m : way at the keyframes that have a place.
        """
        way_m = np.abs(self._finder.way_m[stretch.start : stretch.stop, None] - known_m[None, :])
        coasted_m = sum(self._local.keyframes[k].coasted_m for k in stretch)
        coasted_rad = sum(self._local.keyframes[k].coasted_rad for k in stretch)
        metres, radians = way_deviation(
            float(way_m.min()), self._unit, coasted_m=coasted_m, coasted_rad=coasted_rad
        )
        loops = self._settings.loops
        widest_m = loops.max_reach * self._unit
        return min(loops.deviations * metres, widest_m), loops.deviations * radians
