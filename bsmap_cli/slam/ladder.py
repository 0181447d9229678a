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


def track_down(
    levels: Sequence[CurveMap],
    clusters: Sequence[Clusters],
    start_pose: Vector,
    prior_pose: Vector,
    prior_information: Points,
    *,
    explained: float,
    sigma_m: float,
    settings: SlamSettings,
) -> RegistrationResult:
    """Register the scan that follows the last one, by the method that is set.

    Scans that follow each other closely begin within reach of the finest level, and most end
    there. Of new ground less lies on the map, from any pose: what the last scan had on it,
    `explained`, is the measure. Where curves are registered to curves, the points say in the end
    how well the pose fits.
    """
    method = settings.registration.method
    if method == "points":
        quick = register(
            levels[-1],
            clusters[-1],
            start_pose,
            prior_pose,
            prior_information,
            sigma_m=sigma_m,
            settings=settings.registration,
        )
        enough = max(settings.registration.shortcut * explained, settings.recovery.search_below)
        if quick.inlier_ratio >= enough and not quick.degenerate:
            return quick
    by_curves = {"points": 0, "joint_first": 1}.get(method, len(levels))
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
