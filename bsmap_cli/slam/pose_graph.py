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


def _step(poses: Points, i: Integers, j: Integers, residual: Points, information: Points) -> Points:
    """One Gauss-Newton step; node 0 stays where it is."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import splu

    a, b = _jacobians(poses, i, j)
    wa, wb = information @ a, information @ b
    blocks = np.concatenate(
        (
            np.swapaxes(a, 1, 2) @ wa,
            np.swapaxes(a, 1, 2) @ wb,
            np.swapaxes(b, 1, 2) @ wa,
            np.swapaxes(b, 1, 2) @ wb,
        )
    )
    at, to = np.concatenate((i, i, j, j)), np.concatenate((i, j, i, j))
    free = (at > 0) & (to > 0)
    three = np.arange(3)
    rows = np.broadcast_to(3 * (at[free, None, None] - 1) + three[:, None], (free.sum(), 3, 3))
    columns = np.broadcast_to(3 * (to[free, None, None] - 1) + three, rows.shape)
    n = 3 * (len(poses) - 1)
    diagonal = np.arange(n)
    hessian = coo_matrix(
        (
            np.concatenate((blocks[free].ravel(), np.full(n, 1e-9))),
            (
                np.concatenate((rows.ravel(), diagonal)),
                np.concatenate((columns.ravel(), diagonal)),
            ),
        ),
        shape=(n, n),
    ).tocsc()
    gradient = np.zeros((len(poses), 3))
    np.add.at(gradient, i, np.einsum("eab,ea->eb", wa, residual))
    np.add.at(gradient, j, np.einsum("eab,ea->eb", wb, residual))
    solver = splu(
        hessian, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    step = np.zeros_like(poses)
    step[1:] = -solver.solve(gradient[1:].ravel()).reshape(-1, 3)
    return step


def optimise(
    poses: Points, edges: EdgeList, *, rounds: int = 6, tolerance: float = 1e-5
) -> Optimised:
    """Poses that fit the edges best, from (n, 3) `poses` [m, rad]; node 0 is the anchor."""
    poses = np.array(poses, float)
    if len(poses) < 2 or not len(edges):
        return Optimised(poses, np.ones(sum(edges.loop)), 0)
    i, j = np.array(edges.first), np.array(edges.second)
    measured, information = np.array(edges.pose), np.array(edges.information)
    loop = np.array(edges.loop)
    weights = np.ones(len(i))
    iterations = 0
    for width in GRADUATION ** np.arange(2 * (rounds - 1), -1, -2.0) if loop.any() else [1.0]:
        for _ in range(4 if width > 1.0 else 10):
            residual = edge_residuals(poses, i, j, measured)
            squared = np.einsum("ea,eab,eb->e", residual, information, residual)
            scale = width * CHI_SQUARE_99
            weights[loop] = (scale / (scale + squared[loop])) ** 2
            step = _step(poses, i, j, residual, information * weights[:, None, None])
            poses += step
            iterations += 1
            if np.abs(step).max() < tolerance:
                break
    residual = edge_residuals(poses, i, j, measured)
    squared = np.einsum("ea,eab,eb->e", residual, information, residual)[loop]
    return Optimised(poses, (CHI_SQUARE_99 / (CHI_SQUARE_99 + squared)) ** 2, iterations)
