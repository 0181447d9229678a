"""Fit a curve to ordered points by least squares: Sec. III-C, eqs. (6)-(8)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bsmap_cli.errors import FitError
from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.geometry.compiled import inlined, lean, lean_part
from bsmap_cli.geometry.curve import Curve
from bsmap_cli.geometry.kernels import basis_weights, magnitude
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.control_points import fit_control_points
from bsmap_cli.settings import setting

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
