"""Two maps of one place: laid over each other, compared, made one."""

from __future__ import annotations

from typing import Any

import numpy as np

from bsmap_cli import __version__
from bsmap_cli.config import Settings
from bsmap_cli.errors import TrackingError
from bsmap_cli.evaluation.map_difference import MapDifference, map_difference
from bsmap_cli.evaluation.pose_arrays import transform_poses
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.cleanup import tidy
from bsmap_cli.mapping.freeze import freeze_level
from bsmap_cli.mapping.fusion import fuse_level
from bsmap_cli.mapping.map_document import MapDocument, MapLevel
from bsmap_cli.mapping.resampling import one_level, resampled_level
from bsmap_cli.mapping.thaw import thaw_level
from bsmap_cli.pipeline.memory_needed import refuse_beyond_memory
from bsmap_cli.slam.known_map import settings_for_map
from bsmap_cli.slam.map_placing import MapPlacer, Placement

BYTES_EACH = 900.0  # that placing a map takes for each control point of both
SUMS = ("scans", "scans_used", "travelled_m")  # of the description, where both maps have them


def place_map(
    a: MapDocument, b: MapDocument, settings: Settings, at: SE2 | None = None
) -> Placement:
    """Where map B lies in map A, searched for, or next to the pose `at` of B's frame in A.

    Raises
    ------
    MapFileError : one of the maps draws nothing.
    TrackingError : no place fits, or more than one.
    UsageError : there is not memory enough for maps so large.
    """
    points = sum(len(level.weights) for each in (a, b) for level in each.chosen_levels())
    refuse_beyond_memory(points, BYTES_EACH, "laying maps over each other that have")
    placer = MapPlacer(a, b, settings)
    if at is not None:
        return placer.near(at)
    found = placer.search()
    if found is None:
        raise TrackingError(
            "the maps show no place in common, or more than one would fit: tell with "
            "--at X,Y,YAW_DEG where the origin of the second lies in the first"
        )
    return found


def compare_maps(
    a: MapDocument, b: MapDocument, placement: Placement, *, tolerance_m: float | None = None
) -> MapDifference:
    """What differs between A and B."""
    return map_difference(a, b, placement.pose_a_b, tolerance_m=tolerance_m)


def merge_maps(
    a: MapDocument, b: MapDocument, placement: Placement, settings: Settings
) -> MapDocument:
    """One map from two, in the frame, of the degree and with the knot steps of A.

    What both have becomes one, by weight; the path is A's and then B's.
    """
    settings = settings_for_map(settings, a)
    cap = max(a.max_weight, b.max_weight)
    levels = []
    for level in (one_level(a),) if a.parts else a.levels:
        curve_map = thaw_level(level)
        other = _level_like(b, level).moved(placement.pose_a_b)
        fuse_level(curve_map, other, settings)
        tidy(curve_map, min_length=settings.segmentation.min_length)
        levels.append(freeze_level(curve_map, max_weight=cap))
    path = transform_poses(placement.pose_a_b, b.path.astype(np.float64)).astype(np.float32)
    return MapDocument(
        degree=a.degree,
        max_weight=cap,
        levels=tuple(levels),
        meta=_merged_meta(a.meta, b.meta),
        path=np.concatenate((a.path, path)),
    )


def _level_like(document: MapDocument, level: MapLevel) -> MapLevel:
    """The curves of a map on the lattice step and of the degree of a level of another."""
    same = [each for each in document.levels if each.knot_step_m == level.knot_step_m]
    found = one_level(document) if document.parts or not same else same[0]
    if found.knot_step_m == level.knot_step_m and found.degree == level.degree:
        return found
    return resampled_level(found, level.knot_step_m, level.degree)


def _merged_meta(a: dict[str, Any], b: dict[str, Any]) -> dict[str, Any]:
    """What is known of the making of both."""
    meta = {**a, "software": f"bsmap {__version__}"}
    for key in SUMS:
        if isinstance(a.get(key), int | float) and isinstance(b.get(key), int | float):
            meta[key] = a[key] + b[key]
    if isinstance(a.get("logs", []), list) and isinstance(b.get("logs", []), list):
        meta["logs"] = [*a.get("logs", []), *b.get("logs", [])]
    return meta
