"""Control points that fit points with known parameters best: eqs. (6) and (8)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from bsmap_cli.geometry.compiled import inlined, kernel, lean_part, part
from bsmap_cli.geometry.kernels import basis_weights, solve_banded
from bsmap_cli.geometry.se2 import Points, Vector

RIDGE = 1e-8  # of the largest diagonal entry: keeps unobserved control points defined
BEND_PENALTY = 1.0  # of `penalty`, on second differences where data are thin: ends go on straight
ANCHOR = 1e-4  # of the same, to where a known control point lies


class FitRoom(NamedTuple):
    """Where one fit after another is worked out: to allocate room for each costs more than the fit.

    known : (n, 2) control points that the map has, where is_known : (n,) is 1 and not 0.
    solution : (n, 2) control points of the fit; share : (n,) of a span's data under each.
    band : (n, 4 or more), basis : (d + 1,) for the work.
    """

    known: Points
    is_known: Vector
    solution: Points
    share: Vector
    band: Points
    basis: Vector


@part
def fit_room(rows: int, order: int) -> FitRoom:
    """Room for fits of up to `rows` control points."""
    return FitRoom(
        np.empty((rows, 2)),
        np.empty(rows),
        np.empty((rows, 2)),
        np.empty(rows),
        np.empty((rows, max(order, 4))),
        np.empty(order),
    )


@lean_part
def fit_rms(
    u: Vector,
    points: Points,
    weights: Vector,
    matrix: Points,
    first_span: int,
    count: int,
    room: FitRoom,
) -> float:
    """Weighted root mean square distance [m] of points from the fit, each at its parameter."""
    order = matrix.shape[0]
    squares = total = 0.0
    for j in range(len(u)):
        span = min(max(math.floor(u[j]) - first_span, 0), count - order)
        basis_weights(matrix, u[j] - first_span - span, room.basis)
        ex, ey = points[j, 0], points[j, 1]
        for a in range(order):
            ex -= room.basis[a] * room.solution[span + a, 0]
            ey -= room.basis[a] * room.solution[span + a, 1]
        squares += weights[j] * (ex * ex + ey * ey)
        total += weights[j]
    return math.sqrt(squares / max(total, 1e-300))


@inlined
def _add_point(order: int, span: int, weight: float, x: float, y: float, room: FitRoom) -> None:
    """One point's part of the normal equations of eq. (8)."""
    for a in range(order):
        weighted = weight * room.basis[a]
        room.share[span + a] += weighted
        room.solution[span + a, 0] += weighted * x
        room.solution[span + a, 1] += weighted * y
        for b in range(a, order):
            room.band[span + a, b - a] += weighted * room.basis[b]


@inlined
def _add_difference(stencil: tuple[float, ...], i: int, pull: float, room: FitRoom) -> None:
    """A penalty on the difference that begins at i, held to what it is where all is known."""
    size = len(stencil)
    tx = ty = 0.0
    all_known = 1.0
    for a in range(size):
        all_known *= room.is_known[i + a]
    if all_known > 0.0:
        for a in range(size):
            tx += stencil[a] * room.known[i + a, 0]
            ty += stencil[a] * room.known[i + a, 1]
    for a in range(size):
        pulled = pull * stencil[a]
        room.solution[i + a, 0] += pulled * tx
        room.solution[i + a, 1] += pulled * ty
        for b in range(a, size):
            room.band[i + a, b - a] += pulled * stencil[b]


@lean_part
def solve_fit(
    u: Vector,
    points: Points,
    weights: Vector,
    matrix: Points,
    first_span: int,
    penalty: float,
    n: int,
    room: FitRoom,
) -> bool:
    """`fit_control_points` on the first n rows of a room; leaves the shares there, too."""
    order = matrix.shape[0]
    for i in range(n):
        room.solution[i, 0] = room.solution[i, 1] = room.share[i] = 0.0
        for k in range(room.band.shape[1]):
            room.band[i, k] = 0.0
    mean_x = mean_y = 0.0
    for j in range(len(u)):
        mean_x += points[j, 0]
        mean_y += points[j, 1]
        span = min(max(math.floor(u[j]) - first_span, 0), n - order)
        basis_weights(matrix, u[j] - first_span - span, room.basis)
        if order == 4:  # as a number, for which loops are unrolled
            _add_point(4, span, weights[j], points[j, 0], points[j, 1], room)
        else:
            _add_point(order, span, weights[j], points[j, 0], points[j, 1], room)
    largest = 1e-12
    for i in range(n):
        largest = max(largest, room.band[i, 0])
    mean_x, mean_y = mean_x / len(u), mean_y / len(u)
    for i in range(n):
        known = room.is_known[i] > 0.0
        pull = (ANCHOR if known else RIDGE) * largest
        room.band[i, 0] += pull
        room.solution[i, 0] += pull * (room.known[i, 0] if known else mean_x)
        room.solution[i, 1] += pull * (room.known[i, 1] if known else mean_y)
    for i in range(n - 3):
        _add_difference((-1.0, 3.0, -3.0, 1.0), i, penalty, room)
    for i in range(n - 2):
        weakest = min(room.share[i], room.share[i + 1], room.share[i + 2])
        pull = BEND_PENALTY * penalty * max(0.0, 1.0 - weakest)
        if pull > 0.0:
            _add_difference((1.0, -2.0, 1.0), i, pull, room)
    return solve_banded(room.band[:n], room.solution[:n])


@kernel
def fit_control_points(
    u: Vector,
    points: Points,
    weights: Vector,
    matrix: Points,
    first_span: int,
    penalty: float,
    known: Points,
    is_known: Vector,
    solution: Points,
) -> bool:
    """Minimise eq. (6) plus `penalty` on third differences; control points from g = first_span - d.

    The normal equations B^T W B of eq. (8) are banded: no pseudo-inverse is ever formed. Where
    all control points of a third difference are `known`, it is held to the difference they have,
    so that a correction is smoothed and not the shape of the map. False if the system is singular.
    """
    n, order = len(solution), matrix.shape[0]
    room = FitRoom(
        known, is_known, solution, np.empty(n), np.empty((n, max(order, 4))), np.empty(order)
    )
    return solve_fit(u, points, weights, matrix, first_span, penalty, n, room)
