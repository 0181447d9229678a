"""The submaps as nodes: where each lies by now, and how well any two know of each other."""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.slam.local_slam import LocalSlam
from bsmap_cli.slam.pose_graph import EdgeList, optimise
from bsmap_cli.slam.uncertainty import isotropic_information, way_deviation

GROWN = 1.05  # closures that move little are taken in when the graph has grown by so much
STILL_STEPS = 0.02  # finest knot steps: a solution that still moves by less has converged


class SubmapGraph:
    """Submaps linked one to the next by tracking, and across by loop closures.

    poses : (n, 3) of the submaps in the map frame, from the last optimisation on.
    """

    def __init__(self, local: LocalSlam) -> None:
        self._local = local
        self.poses: Points = np.empty((0, 3))
        self._links: list[tuple[float, float]] = []
        self._loops = EdgeList()
        self._urgent = False
        self._solved = 0
        self._pending = 0
        self._chains: tuple[Vector, Vector, int] | None = None

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
        poses = list(self.poses)
        while len(poses) < len(submaps):
            k = len(poses)
            if k == 0:
                poses.append(submaps[0].pose_local.as_array())
                continue
            step = submaps[k - 1].to_submap(submaps[k].pose_local)
            poses.append((SE2.from_array(poses[-1]) @ step).as_array())
            self._links.append(self._link_deviation(k))
        self.poses = np.array(poses).reshape(-1, 3)
        size = len(poses) + len(self._loops)
        due = begun and self._pending and size >= GROWN * self._solved
        if begun or self._urgent:
            self._chains = None
        if due or self._urgent:
            self._optimise(rounds=6 if self._urgent else 1)
            self._urgent, self._pending, self._solved = False, 0, size

    def add_loop(self, i: int, j: int, pose_i_j: SE2, information: Points, *, urgent: bool) -> None:
        """A closure saw submap j from submap i."""
        self._loops.add(i, j, pose_i_j.as_array(), information, loop=True)
        self._pending += 1
        self._urgent = self._urgent or urgent

    def deviations_from(self, submap: int) -> tuple[Vector, Vector]:
        """Deviation [m] and [rad] of every submap relative to one, along the surest chain."""
        if self._chains is None or self._chains[2] != submap:
            self._chains = (*self._surest_chains(submap), submap)
        return self._chains[0], self._chains[1]

    def _surest_chains(self, submap: int) -> tuple[Vector, Vector]:
        from scipy.sparse import csr_matrix
        from scipy.sparse.csgraph import dijkstra

        n = len(self.poses)
        match = way_deviation(0.0, self._local.settings.ladder[-1])
        chain = np.arange(n - 1)
        first = np.concatenate((chain, np.array(self._loops.first, np.int64)))
        second = np.concatenate((chain + 1, np.array(self._loops.second, np.int64)))
        links = np.array(self._links).reshape(-1, 2)
        deviations = np.concatenate((links, np.tile(match, (len(self._loops), 1))))
        pair = np.minimum(first, second) * n + np.maximum(first, second)
        found = []
        for values in deviations.T:
            lightest = np.lexsort((values, pair))
            kept = lightest[np.unique(pair[lightest], return_index=True)[1]]
            matrix = csr_matrix((values[kept], np.divmod(pair[kept], n)), shape=(n, n))
            chains = dijkstra(matrix, directed=False, indices=np.array([submap]))
            found.append(np.asarray(chains)[0])
        return found[0], found[1]

    def _link_deviation(self, k: int) -> tuple[float, float]:
        """What tracking may have lost between the beginnings of submaps k - 1 and k."""
        local = self._local
        before, behind = local.submaps[k - 1].keyframes, local.submaps[k].keyframes
        # one begun with the last keyframe stays empty where tracking is lost next
        begin = before[0] if before else behind[0] - 1
        end = behind[0] + 1 if behind else before[-1] + 1
        way = coasted = 0.0
        weak = False
        for index in range(begin + 1, min(end, len(local.keyframes))):
            frame = local.keyframes[index]
            step = local.keyframes[index - 1].pose_local.inverse() @ frame.pose_local
            way += math.hypot(step.x, step.y)
            coasted += frame.coasted_m
            weak = weak or frame.weak
        unit = local.settings.ladder[-1]
        return way_deviation(way, unit, coasted_m=coasted, weak=weak)

    def _optimise(self, rounds: int) -> None:
        """Solve anew; where nothing moved much, the sceptical kernel alone will do."""
        edges = EdgeList()
        for k, deviation in enumerate(self._links):
            submaps = self._local.submaps
            step = submaps[k].to_submap(submaps[k + 1].pose_local).as_array()
            edges.add(k, k + 1, step, isotropic_information(deviation), loop=False)
        for e in range(len(self._loops)):
            edges.add(
                self._loops.first[e],
                self._loops.second[e],
                self._loops.pose[e],
                self._loops.information[e],
                loop=True,
            )
        still = STILL_STEPS * self._local.settings.ladder[-1]
        self.poses = optimise(self.poses, edges, rounds=rounds, tolerance_m=still).poses
