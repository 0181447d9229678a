"""Register down the ladder, coarse to fine: the last paragraph of Sec. IV."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.slam.curve_matching import match_curves
from bsmap_cli.slam.registration import RegistrationResult, RegistrationSettings, register

if TYPE_CHECKING:
    from bsmap_cli.slam.slam_settings import SlamSettings


def register_down(
    levels: Sequence[CurveMap],
    clusters: Sequence[Clusters],
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


def register_near(
    levels: Sequence[CurveMap],
    clusters: Sequence[Clusters],
    start_pose: Vector,
    prior_pose: Vector,
    prior_information: Points,
    *,
    enough: float,
    finest: RegistrationResult | None = None,
    sigma_m: float,
    settings: RegistrationSettings,
) -> RegistrationResult:
    """From a pose that is nearly right: on the finest level, down the ladder where that fails.

    enough : share of the points, 0 to 1, that must lie on the finest level to leave it at that.
    finest : what is found there, where that is known already.

    Not for closures: what the finest level explains from a searched pose may be beside the place.
    """
    finest = finest or register(
        levels[-1],
        clusters[-1],
        start_pose,
        prior_pose,
        prior_information,
        sigma_m=sigma_m,
        settings=settings,
    )
    if len(levels) == 1 or (finest.inlier_ratio >= enough and not finest.degenerate):
        return finest
    return register_down(
        levels,
        clusters,
        start_pose,
        prior_pose,
        prior_information,
        sigma_m=sigma_m,
        settings=settings,
    )


def track_down(
    levels: Sequence[CurveMap],
    clusters: Sequence[Clusters],
    start_pose: Vector,
    prior_pose: Vector,
    prior_information: Points,
    *,
    enough: float,
    finest: RegistrationResult | None = None,
    sigma_m: float,
    settings: SlamSettings,
) -> RegistrationResult:
    """Register the scan that follows the last one, by the method that is set.

    enough, finest : as in `register_near`, for points alone; scans that follow each other closely
    begin within reach of the finest level, and most end there. Where curves are registered to
    curves, the points say in the end how well the pose fits.
    """
    method = settings.registration.method
    if method == "points":
        return register_near(
            levels,
            clusters,
            start_pose,
            prior_pose,
            prior_information,
            enough=enough,
            finest=finest,
            sigma_m=sigma_m,
            settings=settings.registration,
        )
    by_curves = 1 if method == "joint_first" else len(levels)
    pose = start_pose
    for level, seen in zip(levels[:by_curves], clusters[:by_curves], strict=True):
        pose = match_curves(
            level, seen, pose, prior_pose, prior_information, sigma_m=sigma_m, settings=settings
        )
    if by_curves < len(levels):
        return register_down(
            levels[by_curves:],
            clusters[by_curves:],
            pose,
            prior_pose,
            prior_information,
            sigma_m=sigma_m,
            settings=settings.registration,
        )
    judged = register(
        levels[-1],
        clusters[-1],
        pose,
        prior_pose,
        prior_information,
        sigma_m=sigma_m,
        settings=settings.registration,
        iterations=1,
    )
    return judged._replace(pose=pose)
