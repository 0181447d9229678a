"""Uniform B-spline basis functions, eq. (1), as polynomials on one span.

In lattice units u = tau / Delta the basis functions of a uniform knot vector are translates of
one cardinal B-spline. On the span u in [k, k + 1) exactly d + 1 of them are not zero, those of
the lattice indices g = k - d .. k, and with f = u - k each is a polynomial in f. The matrix of
their coefficients, worked out once from the recursion, serves every degree alike.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from math import comb, factorial

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

MIN_DEGREE, MAX_DEGREE = 2, 5


@cache
def basis_matrix(degree: int) -> Matrix:
    """(d + 1, d + 1) float64 M: control point g = k - d + a weighs sum_p M[a, p] f^p at f.

    Follows from the recursion of eq. (1), its second denominator corrected to
    t_(j+r+1) - t_(j+1), on integer knots: beta_d(x) = sum_j (-1)^j C(d+1, j) (x - j)_+^d / d!.
    Exact rational arithmetic, rounded once.
    """
    rows = []
    for a in range(degree + 1):
        # on this span the translate a is beta_d(x) at x = f + degree - a
        row = [Fraction(0)] * (degree + 1)
        for j in range(degree - a + 1):
            shift = degree - a - j
            for p in range(degree + 1):
                power = Fraction(comb(degree, p) * shift ** (degree - p))
                row[p] += (-1) ** j * comb(degree + 1, j) * power / factorial(degree)
        rows.append([float(value) for value in row])
    matrix = np.array(rows)
    matrix.setflags(write=False)
    return matrix
