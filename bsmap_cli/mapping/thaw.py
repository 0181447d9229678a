"""From the finished map back to the growing one: the inverse of `freeze`."""

from __future__ import annotations

import numpy as np

from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.map_document import MapLevel


def thaw_level(level: MapLevel) -> CurveMap:
    """A map that scans can be matched against and merged into; curve k is that of row k.

    Frame and lattice stay. Spans that hold a control point of weight 0 are not matched against.
    """
    curves, rows = len(level), len(level.weights)
    curve_map = CurveMap(level.knot_step_m, level.degree, rows=max(256, rows))
    while len(curve_map.arrays.first) <= curves + 1:
        curve_map.arrays.sizes[0] = len(curve_map.arrays.first)
        curve_map.reserve(0)
    curve_map.arrays.sizes[0] = 0
    curve_map.reserve(rows)
    arrays = curve_map.arrays
    begin = level.offsets()
    arrays.sizes[0], arrays.sizes[1] = curves, rows
    arrays.first[:curves] = level.first_indices
    arrays.count[:curves] = level.point_counts
    arrays.offset[:curves] = arrays.low[:curves] = begin[:-1]
    arrays.high[:curves] = begin[1:]
    arrays.seen[:curves] = level.observations
    step = level.knot_step_m
    arrays.support[:curves, 0] = level.first_indices + level.tau_start_m.astype(np.float64) / step
    arrays.support[:curves, 1] = level.first_indices + level.tau_end_m.astype(np.float64) / step
    arrays.points[:rows] = level.control_points
    arrays.weights[:rows] = level.weights
    arrays.owner[:rows] = np.repeat(np.arange(curves), level.point_counts)
    curve_map.reindex()
    return curve_map
