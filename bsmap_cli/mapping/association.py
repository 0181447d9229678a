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
from bsmap_cli.geometry.kernels import foot_point, magnitude, polynomial_jet
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.span_index import nearest_span
from bsmap_cli.settings import setting

MIN_COSINE = 0.5  # a curve is a candidate when it runs within 60 degrees of the scan
NEWTON_STEPS = 4
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
    polynomial: Points,
) -> None:
    """Write curve (-1: none) and parameter u of each point's foot point.

    A point first tries to go on along its neighbour's curve, so that a cluster does not flicker
    between two curves that lie close together.
    """
    degree = matrix.shape[0] - 1
    for c in range(len(starts) - 1):
        row, f = -1, 0.0
        for j in range(starts[c], starts[c + 1]):
            curves[j] = -1
            tx, ty = tangents[j, 0], tangents[j, 1]
            for attempt in range(2):
                if attempt == 1 or row < 0:
                    row, f = nearest_span(
                        level, knot_step_m, points[j, 0], points[j, 1], tx, ty, gate_m, MIN_COSINE
                    )
                    if row < 0:
                        break
                curve = level.owner[row]
                first_row, last_row = usable_rows(level, curve, degree)
                row, f = foot_point(
                    level.points,
                    matrix,
                    row,
                    f,
                    first_row,
                    last_row,
                    points[j, 0],
                    points[j, 1],
                    NEWTON_STEPS,
                    polynomial,
                )
                x, y, dx, dy, _, _ = polynomial_jet(polynomial, f)
                ex, ey = points[j, 0] - x, points[j, 1] - y
                speed = magnitude(dx, dy) + 1e-300
                beyond = abs(ex * dx + ey * dy) / speed > END_TOLERANCE * knot_step_m
                along = (dx * tx + dy * ty) / speed
                indexed = level.span_cell[row] >= 0
                if (
                    indexed
                    and not beyond
                    and along > MIN_COSINE
                    and ex * ex + ey * ey <= gate_m * gate_m
                ):
                    curves[j] = curve
                    u[j] = level.first[curve] + degree + row - level.offset[curve] + f
                    # beyond an end the foot point stops, the parameter goes on
                    u[j] += (ex * dx + ey * dy) / (speed * knot_step_m)
                    break
                row = -1
