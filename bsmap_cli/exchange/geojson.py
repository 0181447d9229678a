"""Maps as GeoJSON: a line for each curve, in local metres or in longitude and latitude."""

from __future__ import annotations

import json
from typing import Any, BinaryIO

import numpy as np

from bsmap_cli.exchange.flatten import TOLERANCE_M, polylines
from bsmap_cli.exchange.geodesy import GeoOrigin
from bsmap_cli.exchange.selection import SelectedLevel, Selection
from bsmap_cli.geometry.se2 import Points
from bsmap_cli.mapping.map_document import CLOSED, TENTATIVE

METRE_DECIMALS, DEGREE_DECIMALS = 5, 10  # a hundredth of a millimetre


def write_geojson(
    stream: BinaryIO,
    selection: Selection,
    *,
    origin: GeoOrigin | None = None,
    tolerance_m: float = TOLERANCE_M,
) -> None:
    """Write a FeatureCollection: a LineString for each curve, or a MultiLineString of its pieces.

    origin : where the map lies on Earth; without it coordinates are metres of the map's frame,
    which the member `bsmap:frame` says. tolerance_m : how far a line may stray from its curve.
    """
    document: dict[str, Any] = {"type": "FeatureCollection"}
    if origin is None:
        document["bsmap:frame"] = selection.frame
    stream.write(_dump(document)[:-1] + b',"features":[')
    separator = b""
    for selected in selection.levels:
        for part in selected.portions():
            features = _features(part, origin, tolerance_m)
            stream.write(separator + b",".join(_dump(feature) for feature in features))
            separator = b","
    stream.write(b"]}\n")


def _dump(value: dict[str, Any]) -> bytes:
    return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()


def _features(
    selected: SelectedLevel, origin: GeoOrigin | None, tolerance_m: float
) -> list[dict[str, Any]]:
    level, features = selected.level, []
    lines = polylines(selected, tolerance_m)
    rows = level.offsets()
    for curve, own in selected.by_curve():
        coordinates = [_coordinates(line, origin) for line in lines[own]]
        geometry = {
            "type": "LineString" if len(coordinates) == 1 else "MultiLineString",
            "coordinates": coordinates[0] if len(coordinates) == 1 else coordinates,
        }
        weights = level.weights[rows[curve] : rows[curve + 1]].astype(float)
        properties = {
            "curve_id": int(level.curve_ids[curve]),
            "knot_step_m": level.knot_step_m,
            "weight": round(float(weights[weights > 0].mean()), 3),
            "observations": int(level.observations[curve]),
            "closed": bool(level.flags[curve] & CLOSED),
            "tentative": bool(level.flags[curve] & TENTATIVE),
        }
        features.append({"type": "Feature", "properties": properties, "geometry": geometry})
    return features


def _coordinates(line: Points, origin: GeoOrigin | None) -> list[list[float]]:
    if origin is None:
        rounded = np.round(line, METRE_DECIMALS)
    else:
        rounded = np.round(origin.longitude_latitude(line), DEGREE_DECIMALS)
    coordinates: list[list[float]] = rounded.tolist()
    return coordinates
