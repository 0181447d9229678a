"""Registration as the paper prints it: a pose and an offset for each curve, then one pose of all.

Sec. IV solves a 4 x 4 Gauss-Newton system for every tracked curve and leaves open how the poses
that come out are joined. Here they are averaged, each with the length over which its curve
overlaps the map.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.slam.curve_equations import CurveEquations, PairSystem

SINGULAR = 1e-6  # smaller eigenvalue ratios leave a direction where it was: a straight wall, an arc
STILL = 1e-4  # a smaller step ends the iteration of a curve [knot steps]


def register_curves(
    system: PairSystem, start_pose: Vector, iterations: int
) -> tuple[Vector, int, NDArray[np.bool_]]:
    """Joined pose (3,), steps taken, and which pairs had a say; `system.offsets` are updated."""
    step_m = system.curve_map.knot_step_m
    poses = np.tile(start_pose, (len(system.offsets), 1))
    moving = np.ones(len(poses), bool)
    steps = 0
    equations = system.linearise(poses)
    while steps < iterations and np.any(moving):
        delta = curve_steps(equations, step_m)
        delta[~moving] = 0.0
        poses += delta[:, :3]
        system.offsets -= delta[:, 3]
        lever = np.sqrt(equations.levers / np.maximum(equations.weights, 1e-300))
        size = np.hypot(delta[:, 0], delta[:, 1]) + lever * np.abs(delta[:, 2])
        moving &= size + step_m * np.abs(delta[:, 3]) > STILL * step_m
        equations = system.linearise(poses)
        steps += 1
    used = equations.overlaps > 0.0
    return _joined(start_pose, poses[used], equations.overlaps[used]), steps, used


def curve_steps(equations: CurveEquations, step_m: float) -> Points:
    """(P, 4) steps dxi, du of each pair alone: H^-1 g, of least norm where H is singular.

    The norm is in metres: angles count with the lever arm of the curve, u with the knot step.
    """
    lever = np.sqrt(equations.levers / np.maximum(equations.weights, 1e-300))
    ones = np.ones(len(lever))
    scale = np.stack((ones, ones, np.maximum(lever, 1e-9), step_m * ones), axis=1)
    hessians = equations.hessians / (scale[:, :, None] * scale[:, None, :])
    values, vectors = np.linalg.eigh(hessians)
    seen = values > SINGULAR * values[:, -1:]
    along = np.einsum("pik,pi->pk", vectors, equations.gradients / scale)
    along = np.where(seen, along / np.where(seen, values, 1.0), 0.0)
    steps: Points = np.einsum("pik,pk->pi", vectors, along) / scale
    return steps


def _joined(start_pose: Vector, poses: Points, lengths: Vector) -> Vector:
    """Mean pose, weighted with the lengths; the start where no curve says anything."""
    if not len(poses):
        return start_pose.copy()
    joined: Vector = start_pose + lengths @ (poses - start_pose) / lengths.sum()
    return joined
