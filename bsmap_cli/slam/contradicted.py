"""Take out of a map what its own keyframes contradict: what came and went while they were taken."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bsmap_cli.geometry.se2 import Points
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.evidence import remove_unseen
from bsmap_cli.slam.keyframes import Keyframe

if TYPE_CHECKING:
    from bsmap_cli.slam.slam_settings import SlamSettings


def remove_contradicted(
    levels: Sequence[CurveMap],
    keyframes: Sequence[Keyframe],
    poses: Points,
    settings: SlamSettings,
    sigma_m: float,
    *,
    old_curves: Sequence[int] | None = None,
) -> None:
    """Weigh what all keyframes, at (n, 3) poses in the frame of the levels, hit and passed.

    old_curves : in each level so many, the first ones, were there before the keyframes.
    """
    if settings.visibility.method == "off":
        return
    views = [
        (keyframe.sight, pose)
        for keyframe, pose in zip(keyframes, poses, strict=True)
        if keyframe.sight is not None
    ]
    for level, old in zip(levels, old_curves or [0] * len(levels), strict=True):
        remove_unseen(
            level,
            views,
            old_curves=old,
            sigma_m=sigma_m,
            settings=settings.visibility,
            min_length=settings.segmentation.min_length,
        )
