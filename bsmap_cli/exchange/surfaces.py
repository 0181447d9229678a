"""True surfaces of a made-up world as GeoJSON in local metres."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from typing import Any

from bsmap_cli.sensor.simulator.world import Surface


def surfaces_geojson(surfaces: Iterable[Surface], frame: str = "world") -> str:
    """One LineString a surface, metres of `frame` to the micrometre; ends with a newline.

    `bsmap:frame` says that the coordinates are not longitude and latitude. A surface that comes or
    goes carries `from_s` or `to_s`, seconds after the first scan.
    """
    document = {
        "type": "FeatureCollection",
        "bsmap:frame": frame,
        "features": [_feature(surface) for surface in surfaces],
    }
    return json.dumps(document, separators=(",", ":"), allow_nan=False) + "\n"


def _feature(surface: Surface) -> dict[str, Any]:
    properties: dict[str, Any] = {"kind": surface.kind}
    for name, value in (("from_s", surface.from_s), ("to_s", surface.to_s)):
        if math.isfinite(value):
            properties[name] = value
    coordinates = [[round(x, 6), round(y, 6)] for x, y in surface.points.tolist()]
    return {
        "type": "Feature",
        "properties": properties,
        "geometry": {"type": "LineString", "coordinates": coordinates},
    }
