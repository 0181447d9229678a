"""Where on a curve a point has its foot: Newton steps from one span to the next.

A span is named by the row of its first control point; f in [0, 1] is the place within it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bsmap_cli.geometry.compiled import inlined
from bsmap_cli.geometry.kernels import SIXTH
from bsmap_cli.geometry.se2 import Points


class Jet(NamedTuple):
    """A curve at one place: position, first and second derivative by u = tau / Delta [m]."""

    x: float
    y: float
    dx: float
    dy: float
    ddx: float
    ddy: float


NO_JET = Jet(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inlined
def span_jet(points: Points, row: int, matrix: Points, f: float) -> Jet:
    """Position and derivatives of span `row`, which is not negative, at f."""
    order = matrix.shape[0]
    if order == 4:  # the cubic, written out: it is asked for more often than anything else
        # unsigned: numba looks whether other indices are negative, and counts from the end then
        first, second = np.uint64(row), np.uint64(row + 1)
        third, fourth = np.uint64(row + 2), np.uint64(row + 3)
        ax, ay = points[first, 0], points[first, 1]
        bx, by = points[second, 0], points[second, 1]
        cx, cy = points[third, 0], points[third, 1]
        third_x = points[fourth, 0] - ax + 3.0 * (bx - cx)
        third_y = points[fourth, 1] - ay + 3.0 * (by - cy)
        second_x, second_y = ax - 2.0 * bx + cx, ay - 2.0 * by + cy
        first_x, first_y = 0.5 * (cx - ax), 0.5 * (cy - ay)
        half = 0.5 * f
        return Jet(
            bx + SIXTH * second_x + f * (first_x + half * (second_x + f * 2.0 * SIXTH * third_x)),
            by + SIXTH * second_y + f * (first_y + half * (second_y + f * 2.0 * SIXTH * third_y)),
            first_x + f * (second_x + half * third_x),
            first_y + f * (second_y + half * third_y),
            second_x + f * third_x,
            second_y + f * third_y,
        )
    x = y = dx = dy = ddx = ddy = 0.0
    for p in range(order - 1, -1, -1):
        ddx, ddy = ddx * f + dx, ddy * f + dy
        dx, dy = dx * f + x, dy * f + y
        x, y = x * f, y * f
        for a in range(order):
            x += matrix[a, p] * points[row + a, 0]
            y += matrix[a, p] * points[row + a, 1]
    return Jet(x, y, dx, dy, 2.0 * ddx, 2.0 * ddy)


@inlined
def foot_point(
    points: Points,
    matrix: Points,
    row: int,
    f: float,
    jet: Jet,
    first_row: int,
    last_row: int,
    px: float,
    py: float,
    steps: int,
    near_m: float,
) -> tuple[int, float, Jet]:
    """The point of a curve nearest to (px, py) by Newton, from span `row` at f with its jet.

    It ends after so many steps, or where (px, py) is no more than `near_m` along the curve from it.
    The search, begun in the spans `first_row` .. `last_row` of the curve, stays inside them. Two
    steps from within half a span leave a tangential residual far below the noise, or `near_m`.
    """
    for _ in range(steps):
        ex, ey = px - jet.x, py - jet.y
        speed2 = jet.dx * jet.dx + jet.dy * jet.dy
        slip = ex * jet.dx + ey * jet.dy
        if slip * slip <= near_m * near_m * speed2:
            break
        bent = ex * jet.ddx + ey * jet.ddy
        f += min(1.0, max(-1.0, slip / (speed2 - min(bent, 0.5 * speed2) + 1e-300)))
        if f < 0.0 and row > first_row:
            row -= 1
            f += 1.0
        elif f > 1.0 and row < last_row:
            row += 1
            f -= 1.0
        f = min(1.0, max(0.0, f))
        jet = span_jet(points, row, matrix, f)
    return row, f, jet
