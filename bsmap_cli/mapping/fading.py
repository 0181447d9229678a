"""Lower the weights of what a scan looks through, as it comes: the counterpart of eq. (12).

As a hit raises the weight alpha of a control point by one, up to gamma_weight, a miss lowers it by
one, and a control point whose weight sinks to nothing goes. That needs no memory of past scans.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import kernel
from bsmap_cli.geometry.se2 import Vector
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.trimming import remove_points
from bsmap_cli.mapping.visibility import HIT, MISS, Look, look_at
from bsmap_cli.sensor.sight import Sight


def fade(
    curve_map: CurveMap,
    sight: Sight,
    pose_map_body: Vector,
    *,
    sigma_m: float,
    min_length: float,
) -> None:
    """Let one scan lower the weights of the control points it looks through.

    `min_length` : what is left of a curve and shorter goes too [knot steps].
    """
    look = look_at(curve_map, sight, pose_map_body, sigma_m)
    gone = np.zeros(int(curve_map.arrays.sizes[1]), bool)
    if _lower_weights(curve_map.arrays, curve_map.degree, look, gone):
        remove_points(curve_map, gone, min_length=min_length)


@kernel
def _lower_weights(level: LevelArrays, degree: int, look: Look, gone: NDArray[np.bool_]) -> bool:
    """alpha <- alpha - 1 where spans are missed and none is hit; marks those that sink to 0."""
    seen = np.zeros(len(gone), np.int8)
    for verdict in (MISS, HIT):
        for i in range(len(look.rows)):
            if look.verdicts[i] == verdict:
                for row in range(look.rows[i], look.rows[i] + degree + 1):
                    seen[row] = verdict
    found = False
    for i in range(len(look.rows)):
        for row in range(look.rows[i], look.rows[i] + degree + 1):
            if seen[row] == MISS:
                seen[row] = 0
                level.weights[row] -= 1.0
                gone[row] = level.weights[row] <= 0.0
                found = found or gone[row]
    return found
