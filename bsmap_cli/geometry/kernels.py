"""Compiled B-spline kernels on plain arrays: one span, one foot point, one small linear system.

A span is named by the row of its first control point; `matrix` is `basis_matrix(degree)` and
f in [0, 1] is the place within the span. Derivatives are with respect to u = tau / Delta.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True)
def basis_weights(matrix: Array, f: float, weights: Array) -> None:
    """Write the d + 1 basis values at f into `weights`."""
    order = matrix.shape[0]
    for a in range(order):
        value = matrix[a, order - 1]
        for p in range(order - 2, -1, -1):
            value = value * f + matrix[a, p]
        weights[a] = value


@njit(cache=True)
def span_polynomial(points: Array, row: int, matrix: Array, polynomial: Array) -> None:
    """Write the (d + 1, 2) power-basis coefficients of one span into `polynomial`."""
    order = matrix.shape[0]
    for p in range(order):
        x = 0.0
        y = 0.0
        for a in range(order):
            weight = matrix[a, p]
            x += weight * points[row + a, 0]
            y += weight * points[row + a, 1]
        polynomial[p, 0] = x
        polynomial[p, 1] = y


@njit(cache=True)
def polynomial_jet(polynomial: Array, f: float) -> tuple[float, float, float, float, float, float]:
    """Position, first and second derivative of a span at f: x, y, dx, dy, ddx, ddy."""
    top = polynomial.shape[0] - 1
    x, y = polynomial[top, 0], polynomial[top, 1]
    dx = dy = ddx = ddy = 0.0
    for p in range(top - 1, -1, -1):
        ddx = ddx * f + dx
        ddy = ddy * f + dy
        dx = dx * f + x
        dy = dy * f + y
        x = x * f + polynomial[p, 0]
        y = y * f + polynomial[p, 1]
    return x, y, dx, dy, 2.0 * ddx, 2.0 * ddy


@njit(cache=True)
def foot_point(
    points: Array,
    matrix: Array,
    row: int,
    f: float,
    first_row: int,
    last_row: int,
    px: float,
    py: float,
    steps: int,
    polynomial: Array,
) -> tuple[int, float]:
    """Newton steps towards the point of the curve nearest to (px, py), from span `row` at f.

    The search may walk over the spans `first_row` .. `last_row` of the curve and ends inside
    them. Two steps from within half a span leave a tangential residual far below the noise.
    """
    span_polynomial(points, row, matrix, polynomial)
    for _ in range(steps):
        x, y, dx, dy, ddx, ddy = polynomial_jet(polynomial, f)
        ex, ey = x - px, y - py
        speed2 = dx * dx + dy * dy
        curvature = ex * ddx + ey * ddy
        step = (ex * dx + ey * dy) / (speed2 + max(curvature, -0.5 * speed2) + 1e-300)
        f -= min(1.0, max(-1.0, step))
        if f < 0.0 and row > first_row:
            row -= 1
            f += 1.0
            span_polynomial(points, row, matrix, polynomial)
        elif f > 1.0 and row < last_row:
            row += 1
            f -= 1.0
            span_polynomial(points, row, matrix, polynomial)
        if abs(step) < 1e-6:
            break
    return row, min(1.0, max(0.0, f))


@njit(cache=True)
def solve_banded(band: Array, rhs: Array) -> bool:
    """Solve a symmetric positive definite banded system in place by Cholesky.

    band : (n, h + 1), band[i, k] = A[i + k, i]; destroyed. rhs : (n, c), becomes the solution.
    False where the matrix is not positive definite.
    """
    n, width = band.shape
    columns = rhs.shape[1]
    for i in range(n):
        if not band[i, 0] > 0.0:
            return False
        pivot = math.sqrt(band[i, 0])
        reach = min(width, n - i)
        for k in range(reach):
            band[i, k] /= pivot
        for k in range(1, reach):
            factor = band[i, k]
            for m in range(k, reach):
                band[i + k, m - k] -= factor * band[i, m]
        for c in range(columns):
            rhs[i, c] /= pivot
            for k in range(1, reach):
                rhs[i + k, c] -= band[i, k] * rhs[i, c]
    for i in range(n - 1, -1, -1):
        reach = min(width, n - i)
        for c in range(columns):
            value = rhs[i, c]
            for k in range(1, reach):
                value -= band[i, k] * rhs[i + k, c]
            rhs[i, c] = value / band[i, 0]
    return True
