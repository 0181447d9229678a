"""Register from a pose that is nearly right: at the finest level, down the ladder if that fails."""

from __future__ import annotations

from collections.abc import Sequence

from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.slam.ladder import register_down
from bsmap_cli.slam.registration import RegistrationResult, RegistrationSettings, register


def register_near(
    levels: Sequence[CurveMap],
    clusters: Sequence[Clusters],
    pose: Vector,
    prior_information: Points,
    *,
    sigma_m: float,
    settings: RegistrationSettings,
) -> RegistrationResult:
    """Start from `pose` (3,), held to it by the prior; most scans never ask the coarser levels.

    Not for closures: what the finest level explains from a searched pose may be beside the place.
    """
    if len(levels) > 1:
        finest = register(
            levels[-1],
            clusters[-1],
            pose,
            pose,
            prior_information,
            sigma_m=sigma_m,
            settings=settings,
        )
        if finest.inlier_ratio >= settings.shortcut and not finest.degenerate:
            return finest
    return register_down(
        levels, clusters, pose, pose, prior_information, sigma_m=sigma_m, settings=settings
    )
