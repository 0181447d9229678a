"""Sparse least squares over poses of the plane, with loop edges that may prove wrong.

Each edge says where node j is seen from node i. Loop edges go through a graduated Geman-McClure
kernel: at first nearly quadratic, so that a right closure far off still pulls, then ever more
sceptical, so that a wrong one is left alone in the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector

Integers = NDArray[np.int64]

CHI_SQUARE_99 = 11.345  # 3 degrees of freedom: what a right closure stays below 99 times in 100
REJECTED = 0.25  # a loop edge with a smaller final weight counts as rejected
GRADUATION = 2.0  # the kernel narrows by this factor from round to round


@dataclass(slots=True)
class EdgeList:
    """Edges as growing columns: i, j, pose of j in the frame of i, information, loop or not."""

    first: list[int] = field(default_factory=list)
    second: list[int] = field(default_factory=list)
    pose: list[Vector] = field(default_factory=list)
    information: list[Points] = field(default_factory=list)
    loop: list[bool] = field(default_factory=list)

    def add(self, i: int, j: int, pose_i_j: Vector, information: Points, *, loop: bool) -> None:
        """One edge; `information` is the inverse covariance of `pose_i_j` in the frame of i."""
        self.first.append(i)
        self.second.append(j)
        self.pose.append(np.asarray(pose_i_j, float))
        self.information.append(np.asarray(information, float))
        self.loop.append(loop)

    def __len__(self) -> int:
        return len(self.first)


@dataclass(frozen=True, slots=True)
class Optimised:
    """poses : (n, 3) of the nodes; loop_weights : final weight of each loop edge, in order."""

    poses: Points
    loop_weights: Vector
    iterations: int


def edge_residuals(poses: Points, i: Integers, j: Integers, measured: Points) -> Points:
    """(e, 3) of R_i^T (t_j - t_i) - t_ij and the angle, in the frame of node i."""
    cos, sin = np.cos(poses[i, 2]), np.sin(poses[i, 2])
    d = poses[j, :2] - poses[i, :2]
    residual = np.empty((len(i), 3))
    residual[:, 0] = cos * d[:, 0] + sin * d[:, 1] - measured[:, 0]
    residual[:, 1] = -sin * d[:, 0] + cos * d[:, 1] - measured[:, 1]
    angle = poses[j, 2] - poses[i, 2] - measured[:, 2]
    residual[:, 2] = angle - math.tau * np.floor(angle / math.tau + 0.5)
    return residual


def _jacobians(poses: Points, i: Integers, j: Integers) -> tuple[Points, Points]:
    """(e, 3, 3) derivatives of the residuals with respect to nodes i and j."""
    cos, sin = np.cos(poses[i, 2]), np.sin(poses[i, 2])
    d = poses[j, :2] - poses[i, :2]
    second = np.zeros((len(i), 3, 3))
    second[:, 0, 0], second[:, 0, 1] = cos, sin
    second[:, 1, 0], second[:, 1, 1] = -sin, cos
    second[:, 2, 2] = 1.0
    first = -second
    first[:, 0, 2] = -sin * d[:, 0] + cos * d[:, 1]
    first[:, 1, 2] = -cos * d[:, 0] - sin * d[:, 1]
    return first, second


class _NormalEquations:
    """Where the blocks of the edges go in the sparse Hessian: the same for every step."""

    def __init__(self, i: Integers, j: Integers, nodes: int) -> None:
        at, to = np.concatenate((i, i, j, j)), np.concatenate((i, j, i, j))
        self.i, self.j, self.nodes = i, j, nodes
        self._free = (at > 0) & (to > 0)  # node 0 stays where it is
        n = 3 * (nodes - 1)
        three = np.arange(3)
        rows = 3 * (at[self._free, None, None] - 1) + three[:, None]
        columns = 3 * (to[self._free, None, None] - 1) + three
        diagonal = np.arange(n) * (n + 1)
        places = np.concatenate(((columns * n + rows).ravel(), diagonal))
        entries, self._entry = np.unique(places, return_inverse=True)
        self._rows = (entries % n).astype(np.int32)
        self._starts = np.searchsorted(entries, np.arange(n + 1) * n).astype(np.int32)

    def step(self, poses: Points, residual: Points, information: Points) -> Points:
        """One Gauss-Newton step."""
        from scipy.sparse import csc_matrix
        from scipy.sparse.linalg import splu

        a, b = _jacobians(poses, self.i, self.j)
        wa, wb = information @ a, information @ b
        at, bt = np.swapaxes(a, 1, 2), np.swapaxes(b, 1, 2)
        blocks = np.concatenate((at @ wa, at @ wb, bt @ wa, bt @ wb))[self._free]
        n = 3 * (self.nodes - 1)
        values = np.bincount(self._entry, np.concatenate((blocks.ravel(), np.full(n, 1e-9))))
        hessian = csc_matrix((values, self._rows, self._starts), shape=(n, n))
        pull = residual[:, :, None]
        gradient = _sum_at(self.i, (np.swapaxes(wa, 1, 2) @ pull)[:, :, 0], self.nodes)
        gradient += _sum_at(self.j, (np.swapaxes(wb, 1, 2) @ pull)[:, :, 0], self.nodes)
        solver = splu(
            hessian,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        step = np.zeros_like(poses)
        step[1:] = -solver.solve(gradient[1:].ravel()).reshape(-1, 3)
        return step


def _sum_at(nodes: Integers, values: Points, count: int) -> Points:
    """(count, 3) sums of the rows that belong to each node."""
    return np.stack([np.bincount(nodes, column, count) for column in values.T], axis=1)


def optimise(
    poses: Points, edges: EdgeList, *, rounds: int = 6, tolerance_m: float = 1e-4
) -> Optimised:
    """Poses that fit the edges best, from (n, 3) `poses` [m, rad]; node 0 is the anchor.

    It ends where a step moves no node by `tolerance_m`, nor turns one by a tenth of it [rad].
    """
    poses = np.array(poses, float)
    if len(poses) < 2 or not len(edges):
        return Optimised(poses, np.ones(sum(edges.loop)), 0)
    i, j = np.array(edges.first), np.array(edges.second)
    measured, information = np.array(edges.pose), np.array(edges.information)
    loop = np.array(edges.loop)
    equations = _NormalEquations(i, j, len(poses))
    weights = np.ones(len(i))
    iterations = 0
    for width in GRADUATION ** np.arange(2 * (rounds - 1), -1, -2.0) if loop.any() else [1.0]:
        for _ in range(2 if width > 1.0 else 10):  # on the way there, near is enough
            residual = edge_residuals(poses, i, j, measured)
            squared = np.einsum("ea,eab,eb->e", residual, information, residual)
            scale = width * CHI_SQUARE_99
            weights[loop] = (scale / (scale + squared[loop])) ** 2
            step = equations.step(poses, residual, information * weights[:, None, None])
            poses += step
            iterations += 1
            if np.abs(step * (1.0, 1.0, 10.0)).max() < tolerance_m:
                break
    residual = edge_residuals(poses, i, j, measured)
    squared = np.einsum("ea,eab,eb->e", residual, information, residual)[loop]
    return Optimised(poses, (CHI_SQUARE_99 / (CHI_SQUARE_99 + squared)) ** 2, iterations)
