"""Registration as the paper prints it: a pose and an offset for each curve, then one pose of all.

Sec. IV solves a 4 x 4 Gauss-Newton system for every tracked curve and leaves open how the poses
that come out are joined. Here each counts with the inverse of its covariance, as least squares
estimates that from the curve's own residuals: a straight wall then says nothing about the way
along it, and a curve tracked wrongly, which never fits, next to nothing at all. A plain mean, also
one weighted with the curves' lengths, loses the robot even where ranges are exact.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.slam.curve_equations import CurveEquations, PairSystem

SINGULAR = 1e-3  # smaller eigenvalue ratios leave a direction where it was: a straight wall, an arc
STILL = 1e-4  # a smaller step ends the iteration of a curve [knot steps]
EXACT = 1e-3  # residuals count as at least this [knot steps]: no fit is better than its lattice


def register_curves(
    system: PairSystem, start_pose: Vector, *, reach_m: float, iterations: int
) -> tuple[Vector, NDArray[np.bool_]]:
    """Joined pose (3,), and which pairs had a say in it; `system.offsets` are updated.

    None has a curve that after `iterations` steps has not come to rest, has left the map curve, or
    would move the robot further than `reach_m`, within which it is tracked at all.
    """
    step_m = system.curve_map.knot_step_m
    poses = np.tile(start_pose, (len(system.offsets), 1))
    moving = np.ones(len(poses), bool)
    equations = system.linearise(poses)
    for _ in range(iterations):
        delta = curve_steps(equations, step_m)
        delta[~moving] = 0.0
        poses += delta[:, :3]
        system.offsets -= delta[:, 3]  # an argument shift: the paper's sign runs away
        size = np.hypot(delta[:, 0], delta[:, 1]) + _levers(equations) * np.abs(delta[:, 2])
        moving &= size + step_m * np.abs(delta[:, 3]) > STILL * step_m
        equations = system.linearise(poses)
        if not np.any(moving):
            break
    near = np.hypot(*(poses - start_pose)[:, :2].T) <= reach_m
    used = (equations.overlaps > 0.0) & ~moving & near
    return join_poses(start_pose, poses, equations, used, step_m), used


def curve_steps(equations: CurveEquations, step_m: float) -> Points:
    """(P, 4) steps dxi, du of each pair alone: H^-1 g, of least norm where H is singular.

    The norm is in metres: angles count with the lever arm of the curve, u with the knot step.
    """
    lever = np.maximum(_levers(equations), 1e-9)
    ones = np.ones(len(lever))
    scale = np.stack((ones, ones, lever, step_m * ones), axis=1)
    hessians = equations.hessians / (scale[:, :, None] * scale[:, None, :])
    steps: Points = _least_norm(hessians, equations.gradients / scale) / scale
    return steps


def join_poses(
    start_pose: Vector,
    poses: Points,
    equations: CurveEquations,
    used: NDArray[np.bool_],
    step_m: float,
) -> Vector:
    """One pose (3,): sum(S_i / s_i^2) dxi = sum(S_i / s_i^2 dxi_i) over the `used` pairs.

    S_i is the pair's information with its offset eliminated, s_i^2 its mean square residual. The
    start is kept where no curve says anything.
    """
    if not np.any(used):
        return start_pose.copy()
    hessians, weights = equations.hessians[used], equations.weights[used]
    b, d = hessians[:, :3, 3], hessians[:, 3, 3]
    information = hessians[:, :3, :3] - b[:, :, None] * b[:, None, :] / d[:, None, None]
    variances = equations.squares[used] / weights + (EXACT * step_m) ** 2
    information /= variances[:, None, None]
    right = np.einsum("pij,pj->i", information, poses[used] - start_pose)
    lever = np.sqrt(equations.levers[used].sum() / weights.sum())
    scale = np.array([1.0, 1.0, max(lever, 1e-9)])
    total = information.sum(axis=0) / np.outer(scale, scale)
    joined: Vector = start_pose + _least_norm(total[None], (right / scale)[None])[0] / scale
    return joined


def _levers(equations: CurveEquations) -> Vector:
    """(P,) root mean square distance of each scan curve from the body [m]."""
    levers: Vector = np.sqrt(equations.levers / np.maximum(equations.weights, 1e-300))
    return levers


def _least_norm(matrices: Vector, right: Points) -> Points:
    """(P, n) solutions of symmetric systems; nothing along directions that are singular."""
    values, vectors = np.linalg.eigh(matrices)
    seen = values > SINGULAR * values[:, -1:]
    along = np.einsum("pik,pi->pk", vectors, right)
    along = np.where(seen, along / np.where(seen, values, 1.0), 0.0)
    solution: Points = np.einsum("pik,pk->pi", vectors, along)
    return solution
