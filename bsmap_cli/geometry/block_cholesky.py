"""Sparse Cholesky of symmetric positive definite matrices made of 3 x 3 blocks.

Columns are taken in the order of `elimination.eliminate` and each from those to its left (Davis,
Direct Methods for Sparse Linear Systems, 2006, sec. 4.8). A block is a row of nine numbers.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, kernel, lean
from bsmap_cli.geometry.se2 import Points

Integers = NDArray[np.int64]


@inlined
def _subtract_product(target: Points, t: int, left: Points, a: int, right: Points, b: int) -> None:
    """Block t of `target` -= block a of `left` times the transpose of block b of `right`."""
    for r in range(3):
        x, y, z = left[a, 3 * r], left[a, 3 * r + 1], left[a, 3 * r + 2]
        for c in range(3):
            target[t, 3 * r + c] -= (
                x * right[b, 3 * c] + y * right[b, 3 * c + 1] + z * right[b, 3 * c + 2]
            )


@inlined
def _factor_block(block: Points, k: int) -> bool:
    """Put the lower triangle of the 3 x 3 factor into block k, its diagonal inverted."""
    a = block[k]
    if not a[0] > 0.0:
        return False
    a[0] = 1.0 / math.sqrt(a[0])
    a[3] *= a[0]
    a[6] *= a[0]
    rest = a[4] - a[3] * a[3]
    if not rest > 0.0:
        return False
    a[4] = 1.0 / math.sqrt(rest)
    a[7] = (a[7] - a[6] * a[3]) * a[4]
    rest = a[8] - a[6] * a[6] - a[7] * a[7]
    if not rest > 0.0:
        return False
    a[8] = 1.0 / math.sqrt(rest)
    return True


@kernel
def factor(starts: Integers, rows: Integers, diagonal: Points, lower: Points) -> bool:
    """Factor in place; False where the matrix is not positive definite.

    Parameters
    ----------
    starts, rows : structure of the factor, as of `eliminate`.
    diagonal, lower : (n, 9) and (len(rows), 9) blocks of the matrix, then of the factor; where
        the factor alone has entries, zeros.
    """
    count = len(starts) - 1
    place = np.empty(count, np.int64)
    # columns whose next block to use lies in the same row, as linked lists
    head, following, upcoming = np.full(count, -1), np.full(count, -1), starts[:-1].copy()
    for j in range(count):
        for k in range(starts[j], starts[j + 1]):
            place[rows[k]] = k
        column = head[j]
        while column >= 0:
            k, end, after = upcoming[column], starts[column + 1], following[column]
            _subtract_product(diagonal, j, lower, k, lower, k)
            for m in range(k + 1, end):
                _subtract_product(lower, place[rows[m]], lower, m, lower, k)
            upcoming[column] = k + 1
            if k + 1 < end:
                following[column] = head[rows[k + 1]]
                head[rows[k + 1]] = column
            column = after
        if not _factor_block(diagonal, j):
            return False
        d = diagonal[j]
        for k in range(starts[j], starts[j + 1]):
            for r in range(3):
                x = lower[k, 3 * r] * d[0]
                y = (lower[k, 3 * r + 1] - x * d[3]) * d[4]
                lower[k, 3 * r], lower[k, 3 * r + 1] = x, y
                lower[k, 3 * r + 2] = (lower[k, 3 * r + 2] - x * d[6] - y * d[7]) * d[8]
        if starts[j] < starts[j + 1]:
            following[j] = head[rows[starts[j]]]
            head[rows[starts[j]]] = j
    return True


@lean
def solve(starts: Integers, rows: Integers, diagonal: Points, lower: Points, right: Points) -> None:
    """Solve with the factor: (n, 3) `right` becomes the solution, both in the factor's order."""
    count = len(starts) - 1
    for j in range(count):
        d = diagonal[j]
        x = right[j, 0] * d[0]
        y = (right[j, 1] - d[3] * x) * d[4]
        z = (right[j, 2] - d[6] * x - d[7] * y) * d[8]
        right[j, 0], right[j, 1], right[j, 2] = x, y, z
        for k in range(starts[j], starts[j + 1]):
            for r in range(3):
                right[rows[k], r] -= (
                    lower[k, 3 * r] * x + lower[k, 3 * r + 1] * y + lower[k, 3 * r + 2] * z
                )
    for j in range(count - 1, -1, -1):
        x, y, z = right[j, 0], right[j, 1], right[j, 2]
        for k in range(starts[j], starts[j + 1]):
            for r in range(3):
                value = right[rows[k], r]
                x -= lower[k, 3 * r] * value
                y -= lower[k, 3 * r + 1] * value
                z -= lower[k, 3 * r + 2] * value
        d = diagonal[j]
        z *= d[8]
        y = (y - d[7] * z) * d[4]
        right[j, 0], right[j, 1], right[j, 2] = (x - d[3] * y - d[6] * z) * d[0], y, z
