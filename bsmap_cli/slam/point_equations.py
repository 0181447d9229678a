"""Normal equations of a scan's points on map curves: what each step of Sec. IV solves.

Every point touches a curve at its foot point; what is left of its residual is the part along the
curve's normal there. To find the touching curve costs ten times as much as to sum up what it says,
so it is found once, with the circle that the curve follows there, and the point is led along that
circle as long as the pose moves little.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import lean_part
from bsmap_cli.geometry.foot_points import NO_JET, foot_point, span_jet
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.association import END_TOLERANCE, MIN_COSINE, usable_rows
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.span_index import nearest_span

# Variance of a curve's tangent, per variance of a point over Delta^2 and weight. A thin curve is
# not taken for worse than THIN, nor one seen often for surer than OFTEN: scans of a wall err alike,
# by the poses they were laid at and by what the lidar does there.
TANGENT_NOISE, THIN, OFTEN = 0.2, 0.1, 1.0
CONTACT = 6  # foot point x, y [m], unit tangent there, curvature [1/m], variance of the normal
NEWTON_STEPS = 2  # from within half a span or a step along the curve
ON_CIRCLE = 0.1  # so near to its foot point a point is led there by the circle [knot steps]


@lean_part
def touch(
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    points: Points,
    tangents: Points,
    pose: Vector,
    gate_m: float,
    inlier_m: float,
    rows: NDArray[np.int64],
    places: Vector,
    contacts: Points,
) -> None:
    """Find where each point touches the map at this pose; its row becomes -1 if nowhere.

    A point goes on from where it was found last; a new one from its neighbour's foot point. Where
    that curve is not plainly the right one, the index is asked.

    contacts : (n, CONTACT) foot points and the circle that the curve follows there.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    degree = matrix.shape[0] - 1
    tilt = TANGENT_NOISE / (knot_step_m * knot_step_m)
    row, f = -1, 0.0
    jet = NO_JET
    for j in range(len(points)):
        px = cos * points[j, 0] - sin * points[j, 1] + pose[0]
        py = sin * points[j, 0] + cos * points[j, 1] + pose[1]
        tx = cos * tangents[j, 0] - sin * tangents[j, 1]
        ty = sin * tangents[j, 0] + cos * tangents[j, 1]
        known = rows[j] >= 0
        if known:
            row, f = rows[j], places[j]
            jet = span_jet(level.points, row, matrix, f)
        limit_m = gate_m if known else inlier_m
        found, asked = False, False
        while not found:
            if row < 0:
                if asked:
                    break
                row, f = nearest_span(level, knot_step_m, px, py, tx, ty, gate_m, MIN_COSINE)
                if row < 0:
                    break
                jet = span_jet(level.points, row, matrix, f)
                asked, limit_m = True, gate_m
            first_row, last_row = usable_rows(level, level.owner[row], degree)
            row, f, jet = foot_point(
                level.points,
                matrix,
                row,
                f,
                jet,
                first_row,
                last_row,
                px,
                py,
                NEWTON_STEPS,
                ON_CIRCLE * knot_step_m,
            )
            ex, ey = px - jet.x, py - jet.y
            inverse = 1.0 / math.sqrt(jet.dx * jet.dx + jet.dy * jet.dy + 1e-300)
            ux, uy = jet.dx * inverse, jet.dy * inverse
            along, beside = ex * ux + ey * uy, ey * ux - ex * uy
            found = (
                abs(along) <= END_TOLERANCE * knot_step_m
                and ux * tx + uy * ty >= MIN_COSINE
                and abs(beside) <= limit_m
                and level.span_cell[row] >= 0
            )
            if not found:
                row = -1
                continue
            bend = (ux * jet.ddy - uy * jet.ddx) * inverse * inverse
            # at an end the curve goes on straight; near the middle of the circle no foot is near
            inside = 0.0 < f < 1.0 and bend * beside < 0.5
            contacts[j, 0], contacts[j, 1], contacts[j, 2], contacts[j, 3] = jet.x, jet.y, ux, uy
            contacts[j, 4] = bend if inside else 0.0
            contacts[j, 5] = tilt / min(max(level.weights[row + 1], THIN), OFTEN)
            places[j] = f
        rows[j] = row


@lean_part
def accumulate(
    points: Points,
    variances: Vector,
    rows: NDArray[np.int64],
    contacts: Points,
    pose: Vector,
    kernel_m: float,
    inlier_m: float,
    hessian: Points,
    gradient: Vector,
    tally: Vector,
    rows_of_jacobian: Points,
) -> None:
    """Sum the normal equations of all points that touch the map, at a pose near that of `touch`.

    rows_of_jacobian : (n, 5) how the residual of each point moves with x, y and theta, its weight,
    and the variance of the normal of its curve. tally : inliers, sum of their squares, of weighted
    squared levers, of weights, and of the information that noisy tangents feign along a straight
    wall.
    """
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    h00 = h01 = h02 = h11 = h12 = h22 = g0 = g1 = g2 = 0.0
    inliers = squares = lever = total = feigned = 0.0
    for j in range(len(points)):
        if rows[j] < 0:
            rows_of_jacobian[j, 3] = 0.0
            continue
        qx = cos * points[j, 0] - sin * points[j, 1]
        qy = sin * points[j, 0] + cos * points[j, 1]
        ex, ey = qx + pose[0] - contacts[j, 0], qy + pose[1] - contacts[j, 1]
        ux, uy, bend = contacts[j, 2], contacts[j, 3], contacts[j, 4]
        along, beside = ex * ux + ey * uy, ey * ux - ex * uy
        # nearest point of the circle of that curvature, without dividing by it
        a, b = 1.0 - bend * beside, bend * along
        radius = math.sqrt(a * a + b * b + 1e-300)
        inverse = 1.0 / (radius * (1.0 + radius))
        residual = (2.0 * beside - bend * (beside * beside + along * along)) * radius * inverse
        inverse *= 1.0 + radius
        nx, ny = -(a * uy + b * ux) * inverse, (a * ux - b * uy) * inverse
        ratio = residual / kernel_m
        root = 1.0 + ratio * ratio
        weight = 1.0 / (root * root * variances[j])
        turn = ny * qx - nx * qy  # normal . d(R p)/d theta
        h00 += weight * nx * nx
        h01 += weight * nx * ny
        h11 += weight * ny * ny
        h02 += weight * nx * turn
        h12 += weight * ny * turn
        h22 += weight * turn * turn
        g0 -= weight * nx * residual
        g1 -= weight * ny * residual
        g2 -= weight * turn * residual
        lever += weight * (qx * qx + qy * qy)
        total += weight
        tilt = contacts[j, 5] * variances[j]
        feigned += weight * tilt
        rows_of_jacobian[j, 0], rows_of_jacobian[j, 1], rows_of_jacobian[j, 2] = nx, ny, turn
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
