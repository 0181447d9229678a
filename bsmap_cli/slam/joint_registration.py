"""Registration of all curves at once: one pose, and an offset for each curve.

The Gauss-Newton system has the shape of an arrow. With A, b, D the blocks of one curve's 4 x 4
matrix (pose, pose and offset, offset) and g, h its right side, its offset is eliminated:

    S = Lambda_0 + sum (A - b b^T / D)          r = Lambda_0 (x_0 - x) + sum (g - b h / D)
    dx = S^-1 r                                  du_i = (h_i - b_i^T dx) / D_i
"""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.slam.curve_equations import CurveEquations, PairSystem

DEGENERATE_RATIO = 0.01  # smaller eigenvalue ratios of S are made of noise
STILL = 1e-3  # a smaller step ends the iteration [knot steps]


def eliminate_offsets(equations: CurveEquations) -> tuple[Points, Vector]:
    """(3, 3) S and (3,) r of the pose alone, without a prior: the Schur complement."""
    a, b = equations.hessians[:, :3, :3], equations.hessians[:, :3, 3]
    d = np.maximum(equations.hessians[:, 3, 3], 1e-300)
    share = b / d[:, None]
    system = a.sum(axis=0) - share.T @ b
    right = equations.gradients[:, :3].sum(axis=0) - equations.gradients[:, 3] @ share
    return system, right


def offset_steps(equations: CurveEquations, pose_step: Vector) -> Vector:
    """(P,) argument shifts du that go with a step of the pose."""
    d = np.maximum(equations.hessians[:, 3, 3], 1e-300)
    steps: Vector = (equations.gradients[:, 3] - equations.hessians[:, :3, 3] @ pose_step) / d
    return steps


def register_jointly(
    system: PairSystem,
    start_pose: Vector,
    prior_pose: Vector,
    prior_information: Points,
    *,
    variance_m2: float,
    iterations: int,
) -> Vector:
    """Pose (3,); `system.offsets` are updated.

    variance_m2 : of a residual over one knot step of curve, which weighs the data against the
    prior. Directions that the curves do not see keep the prior's pose.
    """
    pose, step_m = start_pose.copy(), system.curve_map.knot_step_m
    for _ in range(iterations):
        equations = system.linearise(np.tile(pose, (len(system.offsets), 1)))
        data, right = eliminate_offsets(equations)
        wanted = prior_pose - pose
        wanted[2] = math.remainder(wanted[2], math.tau)
        full = data / variance_m2 + prior_information
        wish = right / variance_m2 + prior_information @ wanted
        delta = np.linalg.solve(full, wish).astype(np.float64)
        lever = math.sqrt(equations.levers.sum() / max(equations.weights.sum(), 1e-300))
        delta = _keep_unseen(data, lever, wanted, delta)
        pose += delta
        system.offsets -= offset_steps(equations, delta)
        if math.hypot(delta[0], delta[1]) + lever * abs(delta[2]) < STILL * step_m:
            break
    return pose


def _keep_unseen(data: Points, lever_m: float, wanted: Vector, delta: Vector) -> Vector:
    """`delta`, but `wanted` along the directions in which the data say next to nothing."""
    scale = np.array([1.0, 1.0, max(lever_m, 1e-9)])
    values, vectors = np.linalg.eigh(data / np.outer(scale, scale))
    unseen = vectors[:, values <= DEGENERATE_RATIO * values[-1]]
    kept: Vector = delta + (unseen @ (unseen.T @ (scale * (wanted - delta)))) / scale
    return kept
