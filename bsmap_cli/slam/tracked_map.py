"""The map as tracking built it: the curves of all submaps, moved to where the poses put them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.mapping.freeze import freeze_level, join_levels
from bsmap_cli.mapping.map_document import MapLevel
from bsmap_cli.slam.contradicted import remove_contradicted
from bsmap_cli.slam.keyframes import Keyframe
from bsmap_cli.slam.submap import Submap

if TYPE_CHECKING:
    from bsmap_cli.slam.slam_settings import SlamSettings


def tracked_levels(
    submaps: list[Submap],
    keyframes: list[Keyframe],
    poses: Points,
    settings: SlamSettings,
    sigma_m: float,
) -> tuple[MapLevel, ...]:
    """Each level of the ladder; poses : (n, 3) of the keyframes in the map frame.

    A submap moves with its first keyframe. What two submaps hold stays double.
    """
    parts = []
    for submap in submaps:
        if not submap.keyframes:  # begun with the last keyframe
            continue
        first = submap.keyframes[0]
        seen = submap.to_submap(keyframes[first].pose_local)
        pose_map_submap = SE2.from_array(poses[first]) @ seen.inverse()
        moved = [level.moved(pose_map_submap) for level in submap.levels]
        submap.fold()
        if settings.visibility.method == "evidence":
            own = [keyframes[k] for k in submap.keyframes]
            remove_contradicted(moved, own, poses[submap.keyframes], settings, sigma_m)
        max_weight = settings.merging.max_weight
        parts.append([freeze_level(level, max_weight=max_weight) for level in moved])
    return tuple(join_levels(list(level)) for level in zip(*parts, strict=True))
