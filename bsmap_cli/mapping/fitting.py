"""Fit a curve to ordered points by least squares: Sec. III-C, eqs. (6)-(8)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bsmap_cli.errors import FitError
from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.geometry.compiled import inlined, kernel, lean, lean_part, part
from bsmap_cli.geometry.curve import Curve
from bsmap_cli.geometry.kernels import basis_weights, magnitude, solve_banded
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.settings import setting

RIDGE = 1e-8  # of the largest diagonal entry: keeps unobserved control points defined
BEND_PENALTY = 1.0  # of `penalty`, on second differences where data are thin: ends go on straight
ANCHOR = 1e-4  # of the same, to where a known control point lies
SNAP = 1e-4  # lattice units: a parameter this close to a knot lies on it


@dataclass(frozen=True, slots=True, kw_only=True)
class FittingSettings:
    """How points become a curve."""

    parameters: str = setting(
        "arc",
        "parameter of a point: arc length along a smooth first fit, or the chord length of eq. (7)",
        choices=("arc", "chord"),
    )
    penalty: float = setting(
        1e-3, "on third differences of control points, relative to one span's data", minimum=0.0
    )
    first_penalty: float = setting(
        2e-2, "the same for the first fit, which gives the arc length", minimum=0.0
    )
    thinning: float = setting(
        0.2, "points are averaged into bins of this length [knot steps]", minimum=0.0
    )


@lean
def chord_length_parameters(points: Points, start_u: float, knot_step_m: float, u: Vector) -> None:
    """Eq. (7) in lattice units: u_1 = `start_u`, u_j = u_(j-1) + |p_j - p_(j-1)| / Delta."""
    u[0] = start_u
    for j in range(1, len(u)):
        chord = magnitude(points[j, 0] - points[j - 1, 0], points[j, 1] - points[j - 1, 1])
        u[j] = u[j - 1] + chord / knot_step_m


@inlined
def lattice_domain(first_u: float, last_u: float) -> tuple[int, int]:
    """First span and end of the knot vector t_i^k that carries [first_u, last_u]."""
    low = math.floor(first_u + SNAP)
    return low, max(math.ceil(last_u - SNAP), low + 1)


@lean_part
def least_and_greatest(u: Vector) -> tuple[float, float]:
    """Of parameters in any order."""
    least = greatest = u[0]
    for j in range(1, len(u)):
        least, greatest = min(least, u[j]), max(greatest, u[j])
    return least, greatest


@lean
def spacing_weights(u: Vector, longest: float, weights: Vector) -> None:
    """Share of one span that each point stands for: half the way to both neighbours, capped."""
    n = len(u)
    for j in range(n):
        before = min(longest, abs(u[j] - u[j - 1])) if j > 0 else 0.0
        after = min(longest, abs(u[j + 1] - u[j])) if j < n - 1 else 0.0
        weights[j] = 0.5 * (before + after)


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
def _add_difference(
    stencil: tuple[float, ...], size: int, i: int, pull: float, room: FitRoom
) -> None:
    """A penalty on the difference that begins at i, held to what it is where all is known."""
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
        _add_difference((-1.0, 3.0, -3.0, 1.0), 4, i, penalty, room)
    for i in range(n - 2):
        weakest = min(room.share[i], room.share[i + 1], room.share[i + 2])
        pull = BEND_PENALTY * penalty * max(0.0, 1.0 - weakest)
        if pull > 0.0:
            _add_difference((1.0, -2.0, 1.0), 3, i, pull, room)
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


@lean_part
def arc_length_parameters(
    u: Vector,
    control_points: Points,
    matrix: Points,
    first_span: int,
    anchor: int,
    step_m: float,
    basis: Vector,
) -> None:
    """Replace u by arc length / Delta along the fitted curve; u[anchor] stays as it is.

    Raw chord length grows with the noise; a smooth fit through the noise does not.
    basis : (d + 1,) room for the work.
    """
    order = matrix.shape[0]
    spans = len(control_points) - order + 1
    kept = u[anchor]
    samples = 8
    x_before = y_before = 0.0
    arc = 0.0
    last = u[0]
    for j in range(len(u)):
        pieces = 1 if j == 0 else max(1, math.ceil(abs(u[j] - last) * samples))
        start = last
        target = u[j]
        for piece in range(1, pieces + 1):
            v = start + (target - start) * piece / pieces
            span = min(max(math.floor(v) - first_span, 0), spans - 1)
            basis_weights(matrix, v - first_span - span, basis)
            x = y = 0.0
            for a in range(order):
                x += basis[a] * control_points[span + a, 0]
                y += basis[a] * control_points[span + a, 1]
            if j > 0 or piece > 1:
                chord = magnitude(x - x_before, y - y_before)
                arc += math.copysign(chord, target - start) / step_m
            x_before, y_before = x, y
        last = target
        u[j] = arc
    shift = kept - u[anchor]
    for j in range(len(u)):
        u[j] += shift


def fit_curve(
    points: Points,
    settings: FittingSettings,
    *,
    knot_step_m: float,
    degree: int,
    start_m: float = 0.0,
) -> Curve:
    """Fit one uniform non-clamped B-spline to one ordered cluster.

    Parameters
    ----------
    points : (m, 2) float64, ordered cluster [m]; the curve comes back in the same frame.
    start_m : tau_1 [m]: 0 for a new curve, the tracked offset otherwise.

    Returns
    -------
    Curve with n - d - 1 control points minimising eq. (6), supported on [tau_1, tau_m], weights 1.

    Raises
    ------
    FitError : fewer than d + 1 points.

    Notes
    -----
    With `parameters="chord"`, penalty 0 and no arc length this is the paper's fit; a basis function
    that meets the data only with the tip of its support then leaves its control point almost free.
    """
    if len(points) <= degree:
        raise FitError(
            f"{len(points)} points cannot carry a curve of degree {degree}: "
            "raise segmentation.min_points or lower degree"
        )
    matrix = basis_matrix(degree)
    u = np.empty(len(points))
    chord_length_parameters(points, start_m / knot_step_m, knot_step_m, u)
    penalties = [settings.penalty]
    if settings.parameters == "arc":
        penalties.insert(0, settings.first_penalty)
    weights = np.empty(len(u))
    for attempt, penalty in enumerate(penalties):
        low, high = lattice_domain(u[0], u[-1])
        count = high - low + degree
        control_points, none = np.empty((count, 2)), np.zeros((count, 2))
        if settings.parameters == "arc":
            spacing_weights(u, 1.0, weights)
        else:
            weights[:] = (u[-1] - u[0]) / len(u)  # one span's worth of data weighs one
        solved = fit_control_points(
            u, points, weights, matrix, low, penalty, none, np.zeros(count), control_points
        )
        if not solved:
            raise FitError("the points leave a control point undefined: raise fitting.penalty")
        if attempt + 1 < len(penalties):
            arc_length_parameters(
                u, control_points, matrix, low, 0, knot_step_m, np.empty(degree + 1)
            )
    return Curve(
        degree=degree,
        knot_step_m=knot_step_m,
        first_index=low - degree,
        control_points=control_points,
        weights=np.ones(count),
        tau_start_m=u[0] * knot_step_m,
        tau_end_m=u[-1] * knot_step_m,
    )
