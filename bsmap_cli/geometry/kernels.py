"""Compiled B-spline kernels on plain arrays: one span, one small linear system.

A span is named by the row of its first control point; `matrix` is `basis_matrix(degree)` and
f in [0, 1] is the place within the span. Derivatives are with respect to u = tau / Delta.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, lean_part, part

Array = NDArray[np.float64]

SIXTH = 1.0 / 6.0  # a division costs as much as ten products


@inlined
def magnitude(x: float, y: float) -> float:
    """Of a vector; hypot would guard against what metres never come to, at ten times the cost."""
    return math.sqrt(x * x + y * y)


@inlined
def basis_weights(matrix: Array, f: float, weights: Array) -> None:
    """Write the d + 1 basis values at f into `weights`."""
    order = matrix.shape[0]
    if order == 4:  # the cubic, written out
        g = 1.0 - f
        square = f * f
        weights[0] = SIXTH * g * g * g
        weights[1] = SIXTH * (4.0 + square * (3.0 * f - 6.0))
        weights[2] = SIXTH * (1.0 + 3.0 * (f + square - square * f))
        weights[3] = SIXTH * square * f
        return
    for a in range(order):
        value = matrix[a, order - 1]
        for p in range(order - 2, -1, -1):
            value = value * f + matrix[a, p]
        weights[a] = value


@inlined
def span_polynomial(points: Array, row: int, matrix: Array, polynomial: Array) -> None:
    """Write the (d + 1, 2) power-basis coefficients of one span into `polynomial`."""
    order = matrix.shape[0]
    if order == 4:  # the cubic, written out: it is asked for more often than anything else
        for k in range(2):
            p0, p1 = points[row, k], points[row + 1, k]
            p2, p3 = points[row + 2, k], points[row + 3, k]
            polynomial[0, k] = SIXTH * (p0 + 4.0 * p1 + p2)
            polynomial[1, k] = 0.5 * (p2 - p0)
            polynomial[2, k] = 0.5 * (p0 - 2.0 * p1 + p2)
            polynomial[3, k] = SIXTH * (p3 - p0 + 3.0 * (p1 - p2))
        return
    for p in range(order):
        x = 0.0
        y = 0.0
        for a in range(order):
            weight = matrix[a, p]
            x += weight * points[row + a, 0]
            y += weight * points[row + a, 1]
        polynomial[p, 0] = x
        polynomial[p, 1] = y


@inlined
def polynomial_jet(polynomial: Array, f: float) -> tuple[float, float, float, float, float, float]:
    """Position, first and second derivative of a span at f: x, y, dx, dy, ddx, ddy."""
    top = polynomial.shape[0] - 1
    if top == 3:
        ax, ay = 3.0 * polynomial[3, 0] * f, 3.0 * polynomial[3, 1] * f
        bx, by = polynomial[2, 0], polynomial[2, 1]
        cx, cy = polynomial[1, 0], polynomial[1, 1]
        return (
            ((polynomial[3, 0] * f + bx) * f + cx) * f + polynomial[0, 0],
            ((polynomial[3, 1] * f + by) * f + cy) * f + polynomial[0, 1],
            (ax + 2.0 * bx) * f + cx,
            (ay + 2.0 * by) * f + cy,
            2.0 * (ax + bx),
            2.0 * (ay + by),
        )
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


@inlined
def _eliminate_row(band: Array, rhs: Array, i: int, reach: int) -> None:
    """One column of the Cholesky factor, and what it takes from the `reach` - 1 rows below."""
    inverse = 1.0 / math.sqrt(band[i, 0])
    for k in range(reach):
        band[i, k] *= inverse
    x, y = rhs[i, 0] * inverse, rhs[i, 1] * inverse
    rhs[i, 0], rhs[i, 1] = x, y
    for k in range(1, reach):
        factor = band[i, k]
        rhs[i + k, 0] -= factor * x
        rhs[i + k, 1] -= factor * y
        for m in range(k, reach):
            band[i + k, m - k] -= factor * band[i, m]


@inlined
def _substitute_row(band: Array, rhs: Array, i: int, reach: int) -> None:
    x, y = rhs[i, 0], rhs[i, 1]
    for k in range(1, reach):
        x -= band[i, k] * rhs[i + k, 0]
        y -= band[i, k] * rhs[i + k, 1]
    inverse = 1.0 / band[i, 0]
    rhs[i, 0], rhs[i, 1] = x * inverse, y * inverse


@lean_part
def solve_banded(band: Array, rhs: Array) -> bool:
    """Solve a symmetric positive definite banded system in place by Cholesky.

    band : (n, h + 1), band[i, k] = A[i + k, i]; destroyed. rhs : (n, 2), becomes the solution.
    False where the matrix is not positive definite.
    """
    n, width = band.shape
    for i in range(n):
        if not band[i, 0] > 0.0:
            return False
        if width == 4 and i + 4 <= n:  # as a number, for which loops are unrolled
            _eliminate_row(band, rhs, i, 4)
        else:
            _eliminate_row(band, rhs, i, min(width, n - i))
    for i in range(n - 1, -1, -1):
        if width == 4 and i + 4 <= n:
            _substitute_row(band, rhs, i, 4)
        else:
            _substitute_row(band, rhs, i, min(width, n - i))
    return True


@part
def symmetric_eigen3(matrix: Array, values: Array, vectors: Array) -> None:  # noqa: PLR0912
    """Eigenvalues (ascending) and eigenvectors (columns) of a symmetric 3 x 3 matrix, by Jacobi."""
    a = matrix.copy()
    for i in range(3):
        for j in range(3):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(8):
        off = abs(a[0, 1]) + abs(a[0, 2]) + abs(a[1, 2])
        if off <= 1e-14 * (abs(a[0, 0]) + abs(a[1, 1]) + abs(a[2, 2])):
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if a[p, q] == 0.0:
                    continue
                ratio = (a[q, q] - a[p, p]) / (2.0 * a[p, q])
                sign = 1.0 if ratio >= 0.0 else -1.0
                t = sign / (abs(ratio) + math.sqrt(ratio * ratio + 1.0))
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                for k in range(3):
                    akp, akq = a[k, p], a[k, q]
                    a[k, p], a[k, q] = c * akp - s * akq, s * akp + c * akq
                for k in range(3):
                    apk, aqk = a[p, k], a[q, k]
                    a[p, k], a[q, k] = c * apk - s * aqk, s * apk + c * aqk
                for k in range(3):
                    vkp, vkq = vectors[k, p], vectors[k, q]
                    vectors[k, p], vectors[k, q] = c * vkp - s * vkq, s * vkp + c * vkq
    for i in range(3):
        values[i] = a[i, i]
    for i in range(2):
        for j in range(2 - i):
            if values[j] > values[j + 1]:
                values[j], values[j + 1] = values[j + 1], values[j]
                for k in range(3):
                    vectors[k, j], vectors[k, j + 1] = vectors[k, j + 1], vectors[k, j]


@inlined
def solve3(matrix: Array, rhs: Array, solution: Array) -> None:
    """Solve a symmetric positive definite 3 x 3 system by Cholesky."""
    l00 = math.sqrt(max(matrix[0, 0], 1e-300))
    l10, l20 = matrix[1, 0] / l00, matrix[2, 0] / l00
    l11 = math.sqrt(max(matrix[1, 1] - l10 * l10, 1e-300))
    l21 = (matrix[2, 1] - l20 * l10) / l11
    l22 = math.sqrt(max(matrix[2, 2] - l20 * l20 - l21 * l21, 1e-300))
    y0 = rhs[0] / l00
    y1 = (rhs[1] - l10 * y0) / l11
    y2 = (rhs[2] - l20 * y0 - l21 * y1) / l22
    solution[2] = y2 / l22
    solution[1] = (y1 - l21 * solution[2]) / l11
    solution[0] = (y0 - l10 * solution[1] - l20 * solution[2]) / l00
