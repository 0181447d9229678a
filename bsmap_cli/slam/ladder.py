"""Register down the ladder, coarse to fine: the last paragraph of Sec. IV."""

from __future__ import annotations

from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.slam.registration import RegistrationResult, RegistrationSettings, register


def register_down(
    levels: list[CurveMap],
    clusters: list[Clusters],
    start_pose: Vector,
    prior_pose: Vector,
    prior_information: Points,
    *,
    sigma_m: float,
    settings: RegistrationSettings,
) -> RegistrationResult:
    """Each level starts from the pose of the coarser one; the finest gives the result."""
    pose = start_pose
    for level, seen in zip(levels, clusters, strict=True):
        result = register(
            level, seen, pose, prior_pose, prior_information, sigma_m=sigma_m, settings=settings
        )
        pose = result.pose
    return result
