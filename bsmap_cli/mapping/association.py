"""Which map curve each point of a scan belongs to, and where on it: in place of eqs. (4)(5).

The paper tracks the centroids of clusters from scan to scan, which fails as soon as a cluster is
cut elsewhere. Here every point looks for its foot point on the map itself, so that any curve is
found again at any time, and the parameter tau of the point comes with it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, lean
from bsmap_cli.geometry.foot_points import NO_JET, foot_point, span_jet
from bsmap_cli.geometry.kernels import magnitude
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.span_index import nearest_span
from bsmap_cli.settings import setting

MIN_COSINE = 0.5  # a curve is a candidate when it runs within 60 degrees of the scan
NEWTON_STEPS = 4
AT_FOOT = 1e-6  # a point so near to being above its foot point is there [knot steps]
END_TOLERANCE = 0.25  # a foot point may lie this far beyond the data [knot steps]


@dataclass(frozen=True, slots=True, kw_only=True)
class AssociationSettings:
    """How far a scan may lie from the curve it belongs to."""

    method: str = setting(
        "curve",
        "match points to map curves, or centroids of clusters from scan to scan",
        choices=("curve", "centroid"),
    )
    track_dist: float = setting(
        0.5, "longest way from a point to its curve [knot steps]", symbol="gamma_track", minimum=0.0
    )


@inlined
def usable_rows(level: LevelArrays, curve: int, degree: int) -> tuple[int, int]:
    """First and last span row of a curve that data support."""
    offset = level.offset[curve]
    base = level.first[curve] + degree
    low = max(math.floor(level.support[curve, 0]) - base, 0)
    high = min(math.ceil(level.support[curve, 1]) - 1 - base, level.count[curve] - degree - 1)
    return offset + low, offset + max(high, low)


@lean
def match_points(
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    points: Points,
    tangents: Points,
    starts: NDArray[np.int64],
    gate_m: float,
    curves: NDArray[np.int64],
    u: Vector,
) -> None:
    """Write curve (-1: none) and parameter u of each point's foot point.

    A point first tries to go on along its neighbour's curve, so that a cluster does not flicker
    between two curves that lie close together.
    """
    degree = matrix.shape[0] - 1
    jet = NO_JET
    for c in range(len(starts) - 1):
        row, f = -1, 0.0
        for j in range(starts[c], starts[c + 1]):
            curves[j] = -1
            px, py, tx, ty = points[j, 0], points[j, 1], tangents[j, 0], tangents[j, 1]
            asked = False
            while curves[j] < 0:
                if row < 0:
                    if asked:
                        break
                    row, f = nearest_span(level, knot_step_m, px, py, tx, ty, gate_m, MIN_COSINE)
                    asked = True
                    if row < 0:
                        break
                    jet = span_jet(level.points, row, matrix, f)
                curve = level.owner[row]
                first_row, last_row = usable_rows(level, curve, degree)
                row, f, jet = foot_point(
                    level.points,
                    matrix,
                    row,
                    f,
                    jet,
                    first_row,
                    last_row,
                    px,
                    py,
                    NEWTON_STEPS,
                    AT_FOOT * knot_step_m,
                )
                ex, ey = px - jet.x, py - jet.y
                speed = magnitude(jet.dx, jet.dy) + 1e-300
                along_m = (ex * jet.dx + ey * jet.dy) / speed
                if (
                    abs(along_m) <= END_TOLERANCE * knot_step_m
                    and jet.dx * tx + jet.dy * ty > MIN_COSINE * speed
                    and ex * ex + ey * ey <= gate_m * gate_m
                    and level.span_cell[row] >= 0
                ):
                    curves[j] = curve
                    u[j] = level.first[curve] + degree + row - level.offset[curve] + f
                    u[j] += along_m / knot_step_m  # beyond an end the foot point stops, u goes on
                else:
                    row = -1
