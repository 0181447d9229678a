"""Find the pose of a scan on the map: Sec. IV, with the parameter of each point eliminated.

The paper solves for pose and curve offsets of each curve alone. Here all points of all curves
share one pose; each point's tau is its foot point, so what is left of its residual is the part
along the map curve's normal (point-to-curve Gauss-Newton).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from bsmap_cli.geometry.compiled import kernel, part
from bsmap_cli.geometry.kernels import magnitude, solve3
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.settings import setting
from bsmap_cli.slam.degeneracy import keep_unobserved
from bsmap_cli.slam.point_equations import CONTACT, accumulate, touch

SHARED = 10.0  # neighbouring points err alike: so many count as one against the prior
STILL = 5e-3  # a smaller step ends the iteration [knot steps]; a quarter of it is left
NEAR = 0.25  # so far the pose may move before foot points are found anew [knot steps]
SETTLED = 0.05  # found anew where the iteration would end after a longer way [knot steps]
MODEL_ERROR = 0.05  # what a curve cannot follow, as a share of its knot step


@dataclass(frozen=True, slots=True, kw_only=True)
class RegistrationSettings:
    """Gauss-Newton of one scan against one level."""

    method: str = setting(
        "points",
        "points on map curves; the scan's curves jointly, on all levels or the coarsest alone; or "
        "each curve alone and the mean of their poses, as in the paper",
        choices=("points", "joint", "joint_first", "curve"),
    )
    gate: float = setting(
        0.75, "points farther from every curve are not matched [knot steps]", minimum=0.0
    )
    kernel: float = setting(
        0.25, "residual that halves a point's pull, not below 2 sigma [knot steps]", minimum=0.0
    )
    inlier: float = setting(
        0.5, "a matched point counts as inlier, not below 3 sigma [knot steps]", minimum=0.0
    )
    shortcut: float = setting(
        0.9,
        "share that must lie on the finest level to leave the coarser ones out: while tracking, of "
        "what the last scan had on the map; for the finished map, of the whole scan; 2: next to "
        "never",
        minimum=0.0,
    )
    iterations: int = setting(12, "most Gauss-Newton steps a level", minimum=1)
    degenerate: float = setting(
        0.5,
        "a direction is observed when its information exceeds so many times what the noise of "
        "one scan's tangents alone would feign",
        minimum=0.0,
    )
    certain: float = setting(
        0.05,
        "while tracking it is observed, too, when points that no such noise explains give it so "
        "many times that bound",
        minimum=0.0,
    )

    def far_off(self) -> RegistrationSettings:
        """For a place that was searched for: a few points may be of another place like it."""
        return replace(self, certain=math.inf)


class RegistrationResult(NamedTuple):
    """How a registration went.

    pose : (3,) x, y [m], theta [rad] of the body in the map frame.
    information : (3, 3) of the data alone, without the prior; nothing in degenerate directions.
    inlier_ratio : share of the scan's points that lie on the map; rms_m : of their residuals.
    degenerate : directions, 0 to 3, in which the prediction was kept.
    """

    pose: Vector
    information: Points
    inlier_ratio: float
    rms_m: float
    iterations: int
    degenerate: int
    points: int


class Gates(NamedTuple):
    """`RegistrationSettings` in metres, for one level and one range noise, for compiled code."""

    gate_m: float
    kernel_m: float
    inlier_m: float
    iterations: int
    degenerate: float
    certain: float


def gates_of(settings: RegistrationSettings, knot_step_m: float, sigma_m: float) -> Gates:
    """For scans of such a range noise on a level of such a knot step."""
    return Gates(
        gate_m=settings.gate * knot_step_m,
        kernel_m=max(settings.kernel * knot_step_m, 2.0 * sigma_m),
        inlier_m=max(settings.inlier * knot_step_m, 3.0 * sigma_m),
        iterations=settings.iterations,
        degenerate=float(settings.degenerate),
        certain=float(settings.certain),
    )


@part
def gauss_newton(
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    points: Points,
    tangents: Points,
    counts: Vector,
    sigma_m: float,
    pose: Vector,
    prior_pose: Vector,
    prior_information: Points,
    gates: Gates,
    hessian: Points,
    tally: Vector,
) -> tuple[int, int]:
    """Gauss-Newton on `pose` in place; steps taken and degenerate directions."""
    rows, places, variances = np.full(len(points), -1), np.empty(len(points)), np.empty(len(points))
    for j in range(len(points)):
        variances[j] = SHARED * (sigma_m**2 / counts[j] + (MODEL_ERROR * knot_step_m) ** 2)
    gradient, system = np.empty(3), np.empty((3, 3))
    jacobian, contacts = np.empty((len(points), 5)), np.empty((len(points), CONTACT))
    right, delta, wanted = np.empty(3), np.empty(3), np.empty(3)
    start = pose.copy()
    found = 0
    steps = 0
    moved, still = math.inf, False
    for _ in range(gates.iterations):
        if moved > (SETTLED if still else NEAR) * knot_step_m:
            touch(
                level,
                matrix,
                knot_step_m,
                points,
                tangents,
                pose,
                gates.gate_m,
                gates.inlier_m,
                rows,
                places,
                contacts,
            )
            moved = 0.0
        accumulate(
            points,
            variances,
            rows,
            contacts,
            pose,
            gates.kernel_m,
            gates.inlier_m,
            hessian,
            gradient,
            tally,
            jacobian,
        )
        steps += 1
        for i in range(3):
            wanted[i] = prior_pose[i] - pose[i]
        wanted[2] -= 2.0 * math.pi * math.floor(wanted[2] / (2.0 * math.pi) + 0.5)
        for i in range(3):
            right[i] = gradient[i]
            for k in range(3):
                system[i, k] = hessian[i, k] + prior_information[i, k]
                right[i] += prior_information[i, k] * wanted[k]
        solve3(system, right, delta)
        lever = math.sqrt(tally[2] / max(tally[3], 1e-300))
        for i in range(3):
            wanted[i] = start[i] - pose[i]
        least = gates.degenerate * tally[4]
        certain = gates.certain * least
        found = keep_unobserved(hessian, jacobian, lever, least, certain, wanted, delta)
        for i in range(3):
            pose[i] += delta[i]
        step_m = magnitude(delta[0], delta[1]) + lever * abs(delta[2])
        moved += step_m
        still = step_m < STILL * knot_step_m
        if still and moved <= SETTLED * knot_step_m:
            break
    return steps, found


@kernel
def _register(
    arrays: tuple[Any, ...],
    matrix: Points,
    knot_step_m: float,
    points: Points,
    tangents: Points,
    counts: Vector,
    sigma_m: float,
    pose: Vector,
    prior_pose: Vector,
    prior_information: Points,
    gates: tuple[Any, ...],
    hessian: Points,
    tally: Vector,
) -> tuple[int, int]:
    """`gauss_newton` for Python, with level and gates as plain tuples.

    What is no more than a tuple is handed over three times as fast.
    """
    return gauss_newton(
        LevelArrays(*arrays),
        matrix,
        knot_step_m,
        points,
        tangents,
        counts,
        sigma_m,
        pose,
        prior_pose,
        prior_information,
        Gates(*gates),
        hessian,
        tally,
    )


def register(
    curve_map: CurveMap,
    clusters: Clusters,
    start_pose: Vector,
    prior_pose: Vector,
    prior_information: Points,
    *,
    sigma_m: float,
    settings: RegistrationSettings,
    iterations: int | None = None,
) -> RegistrationResult:
    """Register thinned points against one level, from `start_pose`, with a soft prior.

    Parameters
    ----------
    start_pose, prior_pose : (3,) x, y [m], theta [rad] of the body in the map frame.
    prior_information : (3, 3) inverse covariance of the prior.
    sigma_m : range noise [m].
    """
    step = curve_map.knot_step_m
    pose, hessian, tally = start_pose.copy(), np.empty((3, 3)), np.empty(5)
    gates = gates_of(settings, step, sigma_m)
    if iterations:
        gates = gates._replace(iterations=iterations)
    steps, degenerate = _register(
        tuple(curve_map.arrays),
        curve_map.matrix,
        step,
        clusters.points,
        clusters.tangents,
        clusters.counts,
        sigma_m,
        pose,
        prior_pose,
        prior_information,
        tuple(gates),
        hessian,
        tally,
    )
    n = len(clusters.points)
    inliers, squares_m2 = float(tally[0]), float(tally[1])
    ratio, rms_m = inliers / max(n, 1), math.sqrt(squares_m2 / max(inliers, 1.0))
    return RegistrationResult(pose, hessian, ratio, rms_m, steps, degenerate, n)
