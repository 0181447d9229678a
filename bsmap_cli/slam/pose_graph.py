"""Sparse least squares over poses of the plane, with loop edges that may prove wrong.

Each edge says where node j is seen from node i. Loop edges go through a graduated Geman-McClure
kernel: at first nearly quadratic, so that a right closure far off still pulls, then ever more
sceptical, so that a wrong one is left alone in the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bsmap_cli.geometry.block_cholesky import factor, solve
from bsmap_cli.geometry.compiled import inlined, kernel, lean
from bsmap_cli.geometry.elimination import eliminate, neighbours
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.slam.edges import EdgeList, Edges, Integers

CHI_SQUARE_99 = 11.345  # 3 degrees of freedom: what a right closure stays below 99 times in 100
REJECTED = 0.25  # a loop edge with a smaller final weight counts as rejected
GRADUATION = 2.0  # the kernel narrows by this factor from round to round
RIDGES = (1e-9, 1e-6, 1e-3, 1.0)  # on the diagonal; the next where nothing holds a node any more


@dataclass(frozen=True, slots=True)
class Optimised:
    """poses : (n, 3) of the nodes; loop_weights : final weight of each loop edge, in order."""

    poses: Points
    loop_weights: Vector
    iterations: int


@inlined
def linearise(
    pose_i: Vector, pose_j: Vector, measured: Vector, residual: Vector, at_i: Points, at_j: Points
) -> None:
    """Residual R_i^T (t_j - t_i) - t_ij and the angle, in the frame of i; (3, 3) derivatives."""
    cos, sin = math.cos(pose_i[2]), math.sin(pose_i[2])
    dx, dy = pose_j[0] - pose_i[0], pose_j[1] - pose_i[1]
    residual[0] = cos * dx + sin * dy - measured[0]
    residual[1] = -sin * dx + cos * dy - measured[1]
    angle = pose_j[2] - pose_i[2] - measured[2]
    residual[2] = angle - math.tau * math.floor(angle / math.tau + 0.5)
    at_j[0, 0], at_j[0, 1], at_j[0, 2] = cos, sin, 0.0
    at_j[1, 0], at_j[1, 1], at_j[1, 2] = -sin, cos, 0.0
    at_j[2, 0], at_j[2, 1], at_j[2, 2] = 0.0, 0.0, 1.0
    at_i[0, 0], at_i[0, 1], at_i[0, 2] = -cos, -sin, -sin * dx + cos * dy
    at_i[1, 0], at_i[1, 1], at_i[1, 2] = sin, -cos, -cos * dx - sin * dy
    at_i[2, 0], at_i[2, 1], at_i[2, 2] = 0.0, 0.0, -1.0


@inlined
def _weight(residual: Vector, information: Points, width: float) -> float:
    """Geman-McClure: 1 where an edge is met, a quarter at `width` times the usual scatter."""
    squared = 0.0
    for r in range(3):
        for c in range(3):
            squared += residual[r] * information[r, c] * residual[c]
    scale = width * CHI_SQUARE_99
    return (scale / (scale + squared)) ** 2


@inlined
def _add_product(left: Points, right: Points, blocks: Points, k: int) -> None:
    """Block k of `blocks` += transpose of `left` times `right`."""
    for r in range(3):
        for c in range(3):
            blocks[k, 3 * r + c] += (
                left[0, r] * right[0, c] + left[1, r] * right[1, c] + left[2, r] * right[2, c]
            )


@inlined
def _weigh(weight: float, information: Points, jacobian: Points, weighted: Points) -> None:
    for r in range(3):
        for c in range(3):
            weighted[r, c] = weight * (
                information[r, 0] * jacobian[0, c]
                + information[r, 1] * jacobian[1, c]
                + information[r, 2] * jacobian[2, c]
            )


@kernel
def _accumulate(
    poses: Points,
    edges: Edges,
    width: float,
    place: Integers,
    spots: Integers,
    diagonal: Points,
    lower: Points,
    gradient: Points,
) -> None:
    """Sum the normal equations; node 0 stays where it is and has no place in them."""
    residual, at_i, at_j = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    weighted_i, weighted_j = np.empty((3, 3)), np.empty((3, 3))
    for e in range(len(edges.first)):
        i, j = edges.first[e], edges.second[e]
        linearise(poses[i], poses[j], edges.poses[e], residual, at_i, at_j)
        information = edges.informations[e]
        weight = _weight(residual, information, width) if edges.loops[e] else 1.0
        _weigh(weight, information, at_i, weighted_i)
        _weigh(weight, information, at_j, weighted_j)
        for node, jacobian, weighted in ((i, at_i, weighted_i), (j, at_j, weighted_j)):
            if node > 0:
                _add_product(jacobian, weighted, diagonal, place[node - 1])
                for c in range(3):
                    for r in range(3):
                        gradient[place[node - 1], c] += weighted[r, c] * residual[r]
        if spots[e] < 0:
            continue
        if place[j - 1] > place[i - 1]:
            _add_product(at_j, weighted_i, lower, spots[e])
        else:
            _add_product(at_i, weighted_j, lower, spots[e])


@lean
def _find_spots(
    first: Integers,
    second: Integers,
    place: Integers,
    starts: Integers,
    rows: Integers,
    spots: Integers,
) -> None:
    """Which block of the factor belongs to the two nodes of each edge; -1 with node 0."""
    for e in range(len(first)):
        spots[e] = -1
        if first[e] > 0 and second[e] > 0 and first[e] != second[e]:
            a, b = place[first[e] - 1], place[second[e] - 1]
            column, row = min(a, b), max(a, b)
            low, high = starts[column], starts[column + 1]
            while low < high:  # rows ascend
                middle = (low + high) // 2
                if rows[middle] < row:
                    low = middle + 1
                else:
                    high = middle
            spots[e] = low


class _NormalEquations:
    """Order of elimination and structure of the factor: the same for every step."""

    def __init__(self, edges: Edges, nodes: int) -> None:
        free = (edges.first > 0) & (edges.second > 0)  # node 0 stays where it is
        pairs = neighbours(nodes - 1, edges.first[free] - 1, edges.second[free] - 1)
        self._edges = edges
        self._place, self._starts, self._rows = eliminate(*pairs)
        self._spots = np.empty(len(edges.first), np.int64)
        _find_spots(edges.first, edges.second, self._place, self._starts, self._rows, self._spots)

    def step(self, poses: Points, width: float) -> Points:
        """One Gauss-Newton step, with loops weighed by a kernel of that width."""
        step = np.zeros_like(poses)
        for ridge in RIDGES:
            diagonal, lower = np.zeros((len(poses) - 1, 9)), np.zeros((len(self._rows), 9))
            gradient = np.zeros((len(poses) - 1, 3))
            diagonal[:, ::4] = ridge
            _accumulate(
                poses, self._edges, width, self._place, self._spots, diagonal, lower, gradient
            )
            if factor(self._starts, self._rows, diagonal, lower):
                solve(self._starts, self._rows, diagonal, lower, gradient)
                step[1:] = -gradient[self._place]
                break
        return step


@kernel
def _edge_weights(poses: Points, edges: Edges, weights: Vector) -> None:
    """What the kernel of width 1 leaves of each edge."""
    residual, at_i, at_j = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    for e in range(len(weights)):
        i, j = edges.first[e], edges.second[e]
        linearise(poses[i], poses[j], edges.poses[e], residual, at_i, at_j)
        weights[e] = _weight(residual, edges.informations[e], 1.0)


def optimise(
    poses: Points, edges: EdgeList, *, rounds: int = 6, tolerance_m: float = 1e-4
) -> Optimised:
    """Poses that fit the edges best, from (n, 3) `poses` [m, rad]; node 0 is the anchor.

    It ends where a step moves no node by `tolerance_m`, nor turns one by a tenth of it [rad].
    """
    poses, columns = np.array(poses, float), edges.columns
    if len(poses) < 2 or not len(edges):
        return Optimised(poses, np.ones(int(columns.loops.sum())), 0)
    equations = _NormalEquations(columns, len(poses))
    iterations = 0
    widths = GRADUATION ** np.arange(2 * (rounds - 1), -1, -2.0) if columns.loops.any() else (1.0,)
    for width in widths:
        for _ in range(2 if width > 1.0 else 10):  # on the way there, near is enough
            step = equations.step(poses, width)
            poses += step
            iterations += 1
            if np.abs(step * (1.0, 1.0, 10.0)).max() < tolerance_m:
                break
    weights = np.empty(len(edges))
    _edge_weights(poses, columns, weights)
    return Optimised(poses, weights[columns.loops], iterations)
