"""The submaps as nodes: where each lies by now, and how well any two know of each other."""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.geometry.compiled import kernel
from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.slam.edges import EdgeList, Integers
from bsmap_cli.slam.local_slam import LocalSlam
from bsmap_cli.slam.pose_graph import optimise
from bsmap_cli.slam.uncertainty import isotropic_information, way_deviation

GROWN = 1.05  # closures that move little are taken in when the graph has grown by so much
STILL_STEPS = 0.02  # finest knot steps: a solution that still moves by less has converged


def surest_chains(
    source: int, links: Vector, first: Integers, second: Integers, matches: Points
) -> Points:
    """(m, n) least sums of what errs on the way from node `source` to every node, of m kinds.

    links : (m, n - 1) between neighbours; matches : (m, e) of the edges between nodes `first` and
    `second`.
    """
    apart = first != second
    low, high = np.minimum(first, second)[apart], np.maximum(first, second)[apart]
    matches = matches[:, apart]
    by_low, by_high = np.argsort(low, kind="stable"), np.argsort(high, kind="stable")
    found = np.full((len(links), links.shape[1] + 1), math.inf)
    found[:, source] = 0.0
    for kind in range(len(links)):
        _sweep(links[kind], low, high, matches[kind], by_low, by_high, found[kind])
    return found


@kernel
def _sweep(
    links: Vector,
    low: Integers,
    high: Integers,
    matches: Vector,
    by_low: Integers,
    by_high: Integers,
    found: Vector,
) -> None:
    """Up and down the nodes, each asking those that it has passed, until nothing gets less.

    It takes as many rounds as a chain turns, not as it has edges.
    """
    changed = True
    while changed:
        changed = False
        e = 0
        for k in range(1, len(found)):
            least = min(found[k], found[k - 1] + links[k - 1])
            while e < len(high) and high[by_high[e]] <= k:
                least = min(least, found[low[by_high[e]]] + matches[by_high[e]])
                e += 1
            changed = changed or least < found[k]
            found[k] = least
        e = len(low) - 1
        for k in range(len(found) - 2, -1, -1):
            least = min(found[k], found[k + 1] + links[k])
            while e >= 0 and low[by_low[e]] >= k:
                least = min(least, found[high[by_low[e]]] + matches[by_low[e]])
                e -= 1
            changed = changed or least < found[k]
            found[k] = least


class SubmapGraph:
    """Submaps linked one to the next by tracking, and across by loop closures.

    poses : (n, 3) of the submaps in the map frame, from the last optimisation on.
    """

    def __init__(self, local: LocalSlam) -> None:
        self._local = local
        self.poses: Points = np.empty((0, 3))
        self._links: list[tuple[float, float]] = []
        self._edges = EdgeList()
        self._loops = 0
        self._urgent = False
        self._solved = 0
        self._pending = 0
        self._chains: tuple[int, tuple[Vector, Vector, Vector]] | None = None

    def pose(self, submap: int) -> SE2:
        """Where a submap lies in the map frame."""
        return SE2.from_array(self.poses[submap])

    def update(self) -> None:
        """Take in submaps begun since, and optimise anew where loops were added.

        A closure that moves the map is taken in at once, others when the graph has grown: what
        they cost stays in proportion to what tracking costs.
        """
        submaps = self._local.submaps
        begun = len(self.poses) < len(submaps)
        for k in range(len(self.poses), len(submaps)):
            self._begin(k)
        size = len(self.poses) + self._loops
        due = begun and self._pending and size >= GROWN * self._solved
        if begun or self._urgent:
            self._chains = None
        if due or self._urgent:
            # where nothing moved much, the sceptical kernel alone will do
            still = STILL_STEPS * self._local.settings.ladder[-1]
            rounds = 6 if self._urgent else 1
            self.poses = optimise(self.poses, self._edges, rounds=rounds, tolerance_m=still).poses
            self._urgent, self._pending, self._solved = False, 0, size

    def _begin(self, k: int) -> None:
        """Put submap k where tracking from the one before leads."""
        submaps = self._local.submaps
        pose = submaps[k].pose_local
        if k:
            step = submaps[k - 1].to_submap(pose)
            deviation = self._link_deviation(k)
            self._links.append(deviation)
            self._edges.add(k - 1, k, step.as_array(), isotropic_information(deviation), loop=False)
            pose = self.pose(k - 1) @ step
        self.poses = np.concatenate((self.poses, [pose.as_array()]))

    def add_loop(self, i: int, j: int, pose_i_j: SE2, information: Points, *, urgent: bool) -> None:
        """A closure saw submap j from submap i."""
        self._edges.add(i, j, pose_i_j.as_array(), information, loop=True)
        self._loops += 1
        self._pending += 1
        self._urgent = self._urgent or urgent

    def deviations_from(self, submap: int) -> tuple[Vector, Vector, Vector]:
        """Deviation [m] and [rad] of every submap relative to one, along the surest chain.

        The third [m] is what remains of the first over a long way, where what no registration goes
        below errs anew at each link and adds up by squares, and so do the angles, each times its
        distance from here; what is lost along the way may always err to one side.
        """
        if self._chains is None or self._chains[0] != submap:
            self._chains = (submap, self._surest_chains(submap))
        return self._chains[1]

    def _surest_chains(self, submap: int) -> tuple[Vector, Vector, Vector]:
        edges = self._edges.columns
        first, second = edges.first[edges.loops], edges.second[edges.loops]
        links = np.array(self._links).reshape(-1, 2)
        match_m, match_rad = way_deviation(0.0, self._local.settings.ladder[-1])
        levers_m = np.hypot(*(self.poses[:, :2] - self.poses[submap, :2]).T)
        metres, radians, lost_m, squares_m2 = surest_chains(
            submap,
            np.stack(
                (
                    links[:, 0],
                    links[:, 1],
                    links[:, 0] - match_m,
                    match_m**2 + (links[:, 1] * levers_m[1:]) ** 2,
                )
            ),
            first,
            second,
            np.stack(
                (
                    np.full(len(first), match_m),
                    np.full(len(first), match_rad),
                    np.zeros(len(first)),
                    match_m**2 + (match_rad * levers_m[second]) ** 2,
                )
            ),
        )
        return metres, radians, lost_m + np.sqrt(squares_m2)

    def _link_deviation(self, k: int) -> tuple[float, float]:
        """What tracking may have lost between the beginnings of submaps k - 1 and k."""
        local = self._local
        before, behind = local.submaps[k - 1].keyframes, local.submaps[k].keyframes
        # one begun with the last keyframe stays empty where tracking is lost next
        begin = before[0] if before else behind[0] - 1
        end = behind[0] + 1 if behind else before[-1] + 1
        way = coasted_m = coasted_rad = 0.0
        weak = False
        for index in range(begin + 1, min(end, len(local.keyframes))):
            frame = local.keyframes[index]
            step = frame.pose_local.relative_to(local.keyframes[index - 1].pose_local)
            way += math.hypot(step.x, step.y)
            coasted_m += frame.coasted_m
            coasted_rad += frame.coasted_rad
            weak = weak or frame.weak
        unit = local.settings.ladder[-1]
        return way_deviation(way, unit, coasted_m=coasted_m, coasted_rad=coasted_rad, weak=weak)
