"""Register the curves of a scan with the curves of one level: Sec. IV, jointly or one by one."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.slam.curve_equations import PairSystem
from bsmap_cli.slam.curve_pairs import pairing
from bsmap_cli.slam.curve_registration import register_curves
from bsmap_cli.slam.joint_registration import register_jointly
from bsmap_cli.slam.registration import MODEL_ERROR

if TYPE_CHECKING:
    from bsmap_cli.slam.slam_settings import SlamSettings

SAMPLES_PER_STEP = 2.0  # where all curves are registered at once, long ones weigh more
KERNELS = (math.inf, 4.0, 2.0)  # of `registration.kernel`, one after the other: wide, then robust


def match_curves(
    level: CurveMap,
    clusters: Clusters,
    start_pose: Vector,
    prior_pose: Vector,
    prior_information: Points,
    *,
    sigma_m: float,
    settings: SlamSettings,
) -> Vector:
    """(3,) pose of the scan on the level, from `start_pose`."""
    samples, steps = settings.alignment.samples, settings.registration.iterations
    step_m = level.knot_step_m
    pairs_from = pairing(level, clusters, settings)
    if settings.registration.method == "curve":
        system = PairSystem(level, pairs_from(start_pose), samples=samples)
        reach_m = settings.association.track_dist * step_m
        return register_curves(system, start_pose, reach_m=reach_m, iterations=steps)[0]
    kernel_m = max(settings.registration.kernel * step_m, 2.0 * sigma_m)
    pose = start_pose
    for widening in KERNELS:
        system = PairSystem(
            level,
            pairs_from(pose),
            samples=samples,
            dense=SAMPLES_PER_STEP,
            kernel_m=widening * kernel_m,
        )
        pose = register_jointly(
            system,
            pose,
            prior_pose,
            prior_information,
            variance_m2=sigma_m**2 + (MODEL_ERROR * step_m) ** 2,
            iterations=steps,
        )
    return pose
