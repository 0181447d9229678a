"""Normal equations of a scan's points on map curves: what each step of Sec. IV solves.

Every point has a foot point on a curve; what is left of its residual is the part along the
curve's normal there.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, lean_part
from bsmap_cli.geometry.kernels import foot_point, polynomial_jet
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.association import END_TOLERANCE, MIN_COSINE, usable_rows
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.span_index import nearest_span

TANGENT_NOISE = (
    0.2  # variance of a curve's tangent, per variance of a point over Delta^2 and weight
)


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


@inlined
def _step_on(
    level: LevelArrays,
    matrix: Points,
    points: Points,
    pose: Vector,
    cos: float,
    sin: float,
    rows: NDArray[np.int64],
    places: Vector,
    polynomial: Points,
) -> None:
    """One Newton step of all foot points that are known.

    Apart from the sums, so that a processor works on several of these short steps at a time.
    """
    degree = matrix.shape[0] - 1
    for j in range(len(points)):
        row = rows[j]
        if row >= 0:
            px = cos * points[j, 0] - sin * points[j, 1] + pose[0]
            py = sin * points[j, 0] + cos * points[j, 1] + pose[1]
            low, high = usable_rows(level, level.owner[row], degree)
            rows[j], places[j] = foot_point(
                level.points, matrix, row, places[j], low, high, px, py, 1, polynomial
            )


@lean_part
def accumulate(  # noqa: PLR0915
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
    rows_of_jacobian: Points,
    polynomial: Points,
) -> None:
    """Sum the normal equations of all matched points.

    A point goes on from its foot point of the last step; a new one from its neighbour's, and the
    index is asked only where that curve is not plainly the right one.

    rows_of_jacobian : (n, 5) how the residual of each point moves with x, y and theta, its weight,
    and the variance of the normal of its curve. tally : inliers, sum of their squares, of weighted
    squared levers, of weights, and of the information that noisy tangents feign along a straight
    wall.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    h00 = h01 = h02 = h11 = h12 = h22 = g0 = g1 = g2 = 0.0
    inliers = squares = lever = total = feigned = 0.0
    f = residual = ux = uy = 0.0
    noise = TANGENT_NOISE / (knot_step_m * knot_step_m)
    _step_on(level, matrix, points, pose, cos, sin, rows, places, polynomial)
    neighbour: Any = np.int64(-1)  # -1 as a literal would be compiled for itself
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
                level, matrix, knot_step_m, row, places[j], 0, px, py, tx, ty, polynomial
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
            rows_of_jacobian[j, 3] = 0.0
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
        tilt = noise * variances[j] / max(level.weights[row + 1], 0.1)
        feigned += weight * tilt
        rows_of_jacobian[j, 0], rows_of_jacobian[j, 1], rows_of_jacobian[j, 2] = -uy, ux, j2
        rows_of_jacobian[j, 3], rows_of_jacobian[j, 4] = weight, tilt
        if abs(residual) <= inlier_m:
            inliers += 1.0
            squares += residual * residual
    hessian[0, 0], hessian[0, 1], hessian[0, 2] = h00, h01, h02
    hessian[1, 0], hessian[1, 1], hessian[1, 2] = h01, h11, h12
    hessian[2, 0], hessian[2, 1], hessian[2, 2] = h02, h12, h22
    gradient[0], gradient[1], gradient[2] = g0, g1, g2
    tally[0], tally[1], tally[2], tally[3] = inliers, squares, lever, total
    tally[4] = feigned
