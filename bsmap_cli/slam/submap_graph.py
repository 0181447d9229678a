"""The submaps as nodes: where each lies by now, and how well any two know of each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.slam.edges import EdgeList
from bsmap_cli.slam.loop_tasks import Link
from bsmap_cli.slam.pose_graph import optimise
from bsmap_cli.slam.surest_chains import SurestChains
from bsmap_cli.slam.uncertainty import isotropic_information, way_deviation

GROWN = 1.05  # closures that move little are taken in when the graph has grown by so much
STILL_STEPS = 0.02  # finest knot steps: a solution that still moves by less has converged


class SubmapGraph:
    """Submaps linked one to the next by tracking, and across by loop closures.

    poses : (n, 3) of the submaps in the map frame, from the last optimisation on.
    """

    def __init__(self, finest_step_m: float) -> None:
        self.poses: Points = np.empty((0, 3))
        self._unit_m = finest_step_m
        self._match = way_deviation(0.0, finest_step_m)
        self._chains = SurestChains((*self._match, 0.0))
        self._edges = EdgeList()
        self._loops = 0
        self._urgent = False
        self._solved = 0
        self._pending = 0
        self._told: tuple[int, Points] | None = None
        self._far_m: Vector | None = None

    def pose(self, submap: int) -> SE2:
        """Where a submap lies in the map frame."""
        return SE2.from_array(self.poses[submap])

    def update(self, links: Sequence[Link]) -> None:
        """Take in submaps begun since, and optimise anew where loops were added.

        A closure that moves the map is taken in at once, others when the graph has grown: what
        they cost stays in proportion to what tracking costs.
        """
        for link in links:
            self._begin(link)
        size = len(self.poses) + self._loops
        due = links and self._pending and size >= GROWN * self._solved
        if links or self._urgent:
            self._told = None
        if due or self._urgent:
            # where nothing moved much, the sceptical kernel alone will do
            still = STILL_STEPS * self._unit_m
            rounds = 6 if self._urgent else 1
            self.poses = optimise(self.poses, self._edges, rounds=rounds, tolerance_m=still).poses
            self._urgent, self._pending, self._solved = False, 0, size

    def _begin(self, link: Link) -> None:
        """Put a submap where tracking from the one before leads."""
        k, pose = len(self.poses), link.step
        if k:
            metres, radians = link.deviation
            self._chains.begin((metres, radians, metres - self._match[0]))
            information = isotropic_information(link.deviation)
            self._edges.add(k - 1, k, link.step.as_array(), information, loop=False)
            pose = self.pose(k - 1) @ link.step
        else:
            self._chains.begin()
        self.poses = np.concatenate((self.poses, [pose.as_array()]))

    def add_loop(self, i: int, j: int, pose_i_j: SE2, information: Points, *, urgent: bool) -> None:
        """A closure saw submap j from submap i."""
        self._edges.add(i, j, pose_i_j.as_array(), information, loop=True)
        self._chains.match(i, j)
        self._loops += 1
        self._pending += 1
        self._urgent = self._urgent or urgent

    def deviations_from(self, submap: int) -> tuple[Vector, Vector]:
        """Deviation [m] and [rad] of every submap relative to one, along the surest chain.

        What tracking loses along the way may always err to one side.
        """
        metres, radians, _ = self._sums(submap)
        return metres, radians

    def far_deviations_from(self, submap: int) -> Vector:
        """What remains of the deviations [m] over a long way.

        There, what no registration goes below errs anew at each link and adds up by squares, and so
        do the angles, each times its distance from here.
        """
        _, _, lost_m = self._sums(submap)
        if self._far_m is None:
            match_m, match_rad = self._match
            levers_m = np.hypot(*(self.poses[:, :2] - self.poses[submap, :2]).T)
            links_rad, (_, second) = self._chains.links[1], self._chains.matches
            squares_m2 = self._chains.sum_of(
                submap,
                match_m**2 + (links_rad * levers_m[1:]) ** 2,
                match_m**2 + (match_rad * levers_m[second]) ** 2,
            )
            self._far_m = lost_m + np.sqrt(squares_m2)
        return self._far_m

    def _sums(self, submap: int) -> Points:
        """Kept until submaps were begun or the map moved: what a closure tells can wait so long."""
        if self._told is None or self._told[0] != submap:
            self._told, self._far_m = (submap, self._chains.sums(submap)), None
        return self._told[1]
