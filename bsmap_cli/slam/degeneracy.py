"""Directions in which no wall says where the robot is: keep the prediction there."""

from __future__ import annotations

import numpy as np

from bsmap_cli.geometry.compiled import inlined, part
from bsmap_cli.geometry.kernels import symmetric_eigen3
from bsmap_cli.geometry.se2 import Points, Vector

DEVIATIONS = 3.0  # of a normal's noise; what a point tells beyond them is no noise
FACING = 0.25  # cos² of 60 degrees: a normal farther off may be a bent end of another wall


@inlined
def _certain(jacobian: Points, x: float, y: float, turn: float) -> float:
    """Information along a direction from points whose normals noise alone does not explain."""
    total = 0.0
    for j in range(len(jacobian)):
        weight = jacobian[j, 3]
        if weight > 0.0:
            along = jacobian[j, 0] * x + jacobian[j, 1] * y + jacobian[j, 2] * turn
            total += weight * max(
                0.0, along * along - max(FACING, DEVIATIONS * DEVIATIONS * jacobian[j, 4])
            )
    return total


@inlined
def _all_observed(hessian: Points, lever: float, least: float) -> bool:
    """Do all eigenvalues exceed `least`? Then what it leaves is positive definite, by Sylvester."""
    a, b, c = hessian[0, 0] - least, hessian[0, 1], hessian[0, 2] / lever
    d, e = hessian[1, 1] - least, hessian[1, 2] / lever
    f = hessian[2, 2] / (lever * lever) - least
    minor = a * d - b * b
    whole = a * (d * f - e * e) - b * (b * f - c * e) + c * (b * e - c * d)
    return bool(a > 0.0 and minor > 0.0 and whole > 0.0)


@part
def keep_unobserved(
    hessian: Points,
    jacobian: Points,
    lever_m: float,
    least: float,
    certain: float,
    wanted: Vector,
    delta: Vector,
) -> int:
    """Replace the part of `delta` along unobserved directions by that of `wanted`; their number.

    `wanted` leads back to where this level began: the prediction, or what a coarser level saw.

    Directions are judged with angles scaled by the lever arm, so that metres compare with metres,
    and without the prior, which must not make a corridor look observed. What the noise feigned
    there is taken out of `hessian`. A direction is observed with information above `least`, or with
    `certain` of such that no noise explains.
    """
    lever = max(lever_m, 1e-9)
    if _all_observed(hessian, lever, least):  # mostly: no need to know the directions
        return 0
    scaled, values, vectors = hessian.copy(), np.empty(3), np.empty((3, 3))
    for i in range(3):
        scaled[i, 2] /= lever
        scaled[2, i] /= lever
    symmetric_eigen3(scaled, values, vectors)
    found = 0
    for k in range(3):
        if values[k] > least:
            continue
        x, y, turn = vectors[0, k], vectors[1, k], vectors[2, k] / lever
        if _certain(jacobian, x, y, turn) > certain:
            continue
        found += 1
        missing = 0.0
        for i in range(3):
            scale = lever if i == 2 else 1.0
            missing += vectors[i, k] * scale * (wanted[i] - delta[i])
        for i in range(3):
            scale = lever if i == 2 else 1.0
            delta[i] += missing * vectors[i, k] / scale
            for m in range(3):
                other = lever if m == 2 else 1.0
                hessian[i, m] -= values[k] * vectors[i, k] * vectors[m, k] * scale * other
    return found
