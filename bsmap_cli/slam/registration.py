"""Find the pose of a scan on the map: Sec. IV, with the parameter of each point eliminated.

The paper solves for pose and curve offsets of each curve alone. Here all points of all curves
share one pose; each point's tau is its foot point, so what is left of its residual is the part
along the map curve's normal (point-to-curve Gauss-Newton).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, kernel, lean
from bsmap_cli.geometry.kernels import (
    foot_point,
    polynomial_jet,
    solve3,
)
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.association import END_TOLERANCE, MIN_COSINE, usable_rows
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.mapping.span_index import nearest_span
from bsmap_cli.settings import setting
from bsmap_cli.slam.degeneracy import keep_unobserved

SHARED = 10.0  # neighbouring points err alike: so many count as one against the prior
TANGENT_NOISE = (
    0.2  # variance of a curve's tangent, per variance of a point over Delta^2 and weight
)
STILL = 5e-3  # a smaller step ends the iteration [knot steps]; the next would be its square
MODEL_ERROR = 0.05  # what a curve cannot follow, as a share of its knot step


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationSettings:
    """Gauss-Newton of one scan against one level."""

    method: str = setting(
        "points",
        "points on map curves; the scan's curves jointly, on all levels or the coarsest alone; or "
        "each curve alone and the mean of their poses, as in the paper",
        choices=("points", "joint", "joint_first", "curve"),
    )
    gate: float = setting(
        0.75, "points farther from every curve are not matched [knot steps]", minimum=0.0
    )
    kernel: float = setting(
        0.25, "residual that halves a point's pull, not below 2 sigma [knot steps]", minimum=0.0
    )
    inlier: float = setting(
        0.5, "a matched point counts as inlier, not below 3 sigma [knot steps]", minimum=0.0
    )
    shortcut: float = setting(
        0.9,
        "share of points that must lie on the finest level, from the prediction on, to leave the "
        "coarser levels out; above 1: never",
        minimum=0.0,
    )
    iterations: int = setting(12, "most Gauss-Newton steps a level", minimum=1)
    degenerate: float = setting(
        1.0,
        "a direction is observed when its information exceeds so many times what the noise of "
        "the curves' tangents alone would feign",
        minimum=0.0,
    )


@dataclass(frozen=True, slots=True)
class RegistrationResult:
    """How a registration went.

    pose : (3,) x, y [m], theta [rad] of the body in the map frame.
    information : (3, 3) of the data alone, without the prior; nothing in degenerate directions.
    inlier_ratio : share of the scan's points that lie on the map; rms_m : of their residuals.
    degenerate : directions, 0 to 3, in which the prediction was kept.
    """

    pose: Vector
    information: Points
    inlier_ratio: float
    rms_m: float
    iterations: int
    degenerate: int
    points: int


@inlined
def _match(
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    row: int,
    f: float,
    steps: int,
    px: float,
    py: float,
    tx: float,
    ty: float,
    polynomial: Points,
) -> tuple[bool, int, float, float, float, float]:
    """Foot point near f on span `row`: found or not, row, f, residual [m] and unit tangent there.

    The residual is that along the normal (-uy, ux).
    """
    first_row, last_row = usable_rows(level, level.owner[row], matrix.shape[0] - 1)
    row, f = foot_point(
        level.points, matrix, row, f, first_row, last_row, px, py, steps, polynomial
    )
    x, y, dx, dy, _, _ = polynomial_jet(polynomial, f)
    ex, ey = px - x, py - y
    inverse = 1.0 / math.sqrt(dx * dx + dy * dy + 1e-300)
    ux, uy = dx * inverse, dy * inverse
    found = (
        abs(ex * ux + ey * uy) <= END_TOLERANCE * knot_step_m
        and ux * tx + uy * ty >= MIN_COSINE
        and level.span_cell[row] >= 0
    )
    return found, row, f, ey * ux - ex * uy, ux, uy


@lean
def _accumulate(  # noqa: PLR0915
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    points: Points,
    tangents: Points,
    variances: Vector,
    pose: Vector,
    gate_m: float,
    kernel_m: float,
    inlier_m: float,
    rows: NDArray[np.int64],
    places: Vector,
    hessian: Points,
    gradient: Vector,
    tally: Vector,
    polynomial: Points,
) -> None:
    """Sum the normal equations of all matched points.

    A point goes on from its foot point of the last step; a new one from its neighbour's, and the
    index is asked only where that curve is not plainly the right one.

    tally : inliers, sum of their squares, of weighted squared levers, of weights, and of the
    information that noisy tangents feign along a straight wall.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    h00 = h01 = h02 = h11 = h12 = h22 = g0 = g1 = g2 = 0.0
    inliers = squares = lever = total = feigned = 0.0
    f = residual = ux = uy = 0.0
    neighbour = -1
    for j in range(len(points)):
        qx = cos * points[j, 0] - sin * points[j, 1]
        qy = sin * points[j, 0] + cos * points[j, 1]
        px, py = qx + pose[0], qy + pose[1]
        tx = cos * tangents[j, 0] - sin * tangents[j, 1]
        ty = sin * tangents[j, 0] + cos * tangents[j, 1]
        found = False
        row = rows[j]
        if row >= 0:
            found, row, f, residual, ux, uy = _match(
                level, matrix, knot_step_m, row, places[j], 1, px, py, tx, ty, polynomial
            )
            found = found and abs(residual) <= gate_m
        else:
            if neighbour >= 0:
                found, row, f, residual, ux, uy = _match(
                    level, matrix, knot_step_m, neighbour, f, 2, px, py, tx, ty, polynomial
                )
                found = found and abs(residual) <= inlier_m
            if not found:
                row, f = nearest_span(level, knot_step_m, px, py, tx, ty, gate_m, MIN_COSINE)
                if row >= 0:
                    found, row, f, residual, ux, uy = _match(
                        level, matrix, knot_step_m, row, f, 2, px, py, tx, ty, polynomial
                    )
                    found = found and abs(residual) <= gate_m
        neighbour = rows[j] = row if found else -1
        if not found:
            continue
        places[j] = f
        ratio = residual / kernel_m
        root = 1.0 + ratio * ratio
        weight = 1.0 / (root * root * variances[j])
        j2 = qx * ux + qy * uy  # normal . d(R p)/d theta
        h00 += weight * uy * uy
        h01 -= weight * uy * ux
        h11 += weight * ux * ux
        h02 -= weight * uy * j2
        h12 += weight * ux * j2
        h22 += weight * j2 * j2
        g0 += weight * uy * residual
        g1 -= weight * ux * residual
        g2 -= weight * j2 * residual
        lever += weight * (qx * qx + qy * qy)
        total += weight
        feigned += weight * TANGENT_NOISE * variances[j] / max(level.weights[row + 1], 0.1)
        if abs(residual) <= inlier_m:
            inliers += 1.0
            squares += residual * residual
    hessian[0, 0], hessian[0, 1], hessian[0, 2] = h00, h01, h02
    hessian[1, 0], hessian[1, 1], hessian[1, 2] = h01, h11, h12
    hessian[2, 0], hessian[2, 1], hessian[2, 2] = h02, h12, h22
    gradient[0], gradient[1], gradient[2] = g0, g1, g2
    tally[0], tally[1], tally[2], tally[3] = inliers, squares, lever, total
    tally[4] = feigned / (knot_step_m * knot_step_m)


@kernel
def _register(
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    points: Points,
    tangents: Points,
    variances: Vector,
    pose: Vector,
    prior_pose: Vector,
    prior_information: Points,
    gate_m: float,
    kernel_m: float,
    inlier_m: float,
    iterations: int,
    degenerate: float,
    hessian: Points,
    tally: Vector,
) -> tuple[int, int]:
    """Gauss-Newton on `pose` in place; steps taken and degenerate directions."""
    rows, places = np.full(len(points), -1), np.empty(len(points))
    gradient, system, polynomial = np.empty(3), np.empty((3, 3)), np.empty((matrix.shape[0], 2))
    right, delta, wanted = np.empty(3), np.empty(3), np.empty(3)
    start = pose.copy()
    found = 0
    steps = 0
    for _ in range(iterations):
        _accumulate(
            level,
            matrix,
            knot_step_m,
            points,
            tangents,
            variances,
            pose,
            gate_m,
            kernel_m,
            inlier_m,
            rows,
            places,
            hessian,
            gradient,
            tally,
            polynomial,
        )
        steps += 1
        for i in range(3):
            wanted[i] = prior_pose[i] - pose[i]
        wanted[2] -= 2.0 * math.pi * math.floor(wanted[2] / (2.0 * math.pi) + 0.5)
        for i in range(3):
            right[i] = gradient[i]
            for k in range(3):
                system[i, k] = hessian[i, k] + prior_information[i, k]
                right[i] += prior_information[i, k] * wanted[k]
        solve3(system, right, delta)
        for i in range(3):
            wanted[i] = start[i] - pose[i]
        lever = math.sqrt(tally[2] / max(tally[3], 1e-300))
        found = keep_unobserved(hessian, lever, degenerate * tally[4], wanted, delta)
        for i in range(3):
            pose[i] += delta[i]
        moved = math.hypot(delta[0], delta[1]) + lever * abs(delta[2])
        if moved < STILL * knot_step_m:
            break
    return steps, found


def register(
    curve_map: CurveMap,
    clusters: Clusters,
    start_pose: Vector,
    prior_pose: Vector,
    prior_information: Points,
    *,
    sigma_m: float,
    settings: RegistrationSettings,
    iterations: int | None = None,
) -> RegistrationResult:
    """Register thinned points against one level, from `start_pose`, with a soft prior.

    Parameters
    ----------
    start_pose, prior_pose : (3,) x, y [m], theta [rad] of the body in the map frame.
    prior_information : (3, 3) inverse covariance of the prior.
    sigma_m : range noise [m].
    """
    step = curve_map.knot_step_m
    pose, hessian, tally = start_pose.copy(), np.zeros((3, 3)), np.zeros(5)
    variances = SHARED * (sigma_m**2 / clusters.counts + (MODEL_ERROR * step) ** 2)
    steps, degenerate = _register(
        curve_map.arrays,
        curve_map.matrix,
        step,
        clusters.points,
        clusters.tangents,
        variances,
        pose,
        prior_pose,
        prior_information,
        settings.gate * step,
        max(settings.kernel * step, 2.0 * sigma_m),
        max(settings.inlier * step, 3.0 * sigma_m),
        iterations or settings.iterations,
        settings.degenerate,
        hessian,
        tally,
    )
    n = len(clusters.points)
    return RegistrationResult(
        pose=pose,
        information=hessian,
        inlier_ratio=tally[0] / max(n, 1),
        rms_m=math.sqrt(tally[1] / max(tally[0], 1.0)),
        iterations=steps,
        degenerate=degenerate,
        points=n,
    )
