"""The submaps as nodes: where each lies by now, and how well any two know of each other."""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.slam.local_slam import LocalSlam
from bsmap_cli.slam.pose_graph import EdgeList, optimise
from bsmap_cli.slam.uncertainty import isotropic_information, way_deviation


class SubmapGraph:
    """Submaps linked one to the next by tracking, and across by loop closures.

    poses : list of SE2, submap in the map frame, from the last optimisation on.
    """

    def __init__(self, local: LocalSlam) -> None:
        self._local = local
        self.poses: list[SE2] = []
        self._links: list[tuple[float, float]] = []
        self._loops = EdgeList()
        self._stale = self._urgent = False
        self._deviations: dict[int, tuple[Vector, Vector]] = {}

    def update(self) -> None:
        """Take in submaps begun since, and optimise anew where loops were added.

        A closure that moves the map is taken in at once, others when the next submap begins.
        """
        begun = len(self.poses) < len(self._local.submaps)
        submaps = self._local.submaps
        while len(self.poses) < len(submaps):
            k = len(self.poses)
            if k == 0:
                self.poses.append(submaps[0].pose_local)
                continue
            step = submaps[k - 1].to_submap(submaps[k].pose_local)
            self.poses.append(self.poses[-1] @ step)
            self._links.append(self._link_deviation(k))
        if begun or self._urgent:
            self._deviations.clear()
            if self._stale:
                self._optimise(rounds=6 if self._urgent else 1)
            self._stale = self._urgent = False

    def add_loop(self, i: int, j: int, pose_i_j: SE2, information: Points, *, urgent: bool) -> None:
        """A closure saw submap j from submap i."""
        self._loops.add(i, j, pose_i_j.as_array(), information, loop=True)
        self._stale = True
        self._urgent = self._urgent or urgent

    def deviations_from(self, submap: int) -> tuple[Vector, Vector]:
        """Deviation [m] and [rad] of every submap relative to one, along the surest chain."""
        if submap not in self._deviations:
            self._deviations[submap] = self._surest_chains(submap)
        return self._deviations[submap]

    def _surest_chains(self, submap: int) -> tuple[Vector, Vector]:
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import dijkstra

        n = len(self.poses)
        match = way_deviation(0.0, self._local.settings.ladder[-1])
        first = list(range(n - 1)) + self._loops.first
        second = list(range(1, n)) + self._loops.second
        metres = [link[0] for link in self._links] + [match[0]] * len(self._loops)
        radians = [link[1] for link in self._links] + [match[1]] * len(self._loops)
        graph = {}
        for name, deviations in (("m", metres), ("rad", radians)):
            lightest: dict[tuple[int, int], float] = {}
            for i, j, value in zip(first, second, deviations, strict=True):
                key = (min(i, j), max(i, j))
                lightest[key] = min(value, lightest.get(key, math.inf))
            pairs = np.array(list(lightest), np.int64).reshape(-1, 2)
            values = np.array(list(lightest.values()), np.float64)
            matrix = coo_matrix((values, (pairs[:, 0], pairs[:, 1])), shape=(n, n))
            graph[name] = np.asarray(
                dijkstra(matrix.tocsr(), directed=False, indices=np.array([submap]))
            )[0]
        return graph["m"], graph["rad"]

    def _link_deviation(self, k: int) -> tuple[float, float]:
        """What tracking may have lost between the beginnings of submaps k - 1 and k."""
        local = self._local
        begin, end = local.submaps[k - 1].keyframes[0], local.submaps[k - 1].keyframes[-1] + 1
        if local.submaps[k].keyframes:
            end = local.submaps[k].keyframes[0] + 1
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
        poses = np.array([pose.as_array() for pose in self.poses])
        self.poses = [SE2.from_array(pose) for pose in optimise(poses, edges, rounds=rounds).poses]
