"""One point of a curve and its velocity, for compiled code that has a curve's control points."""

from __future__ import annotations

import math

from bsmap_cli.geometry.compiled import lean_part
from bsmap_cli.geometry.foot_points import span_jet
from bsmap_cli.geometry.se2 import Points


@lean_part
def curve_jet(
    points: Points, first: int, matrix: Points, u: float
) -> tuple[float, float, float, float]:
    """s(u) and ds/du: x, y, dx, dy; u = tau / Delta is clamped to the curve's domain.

    points : (N, 2) control points, the first at lattice index `first`.
    """
    degree = matrix.shape[0] - 1
    local = u - (first + degree)
    span = min(max(math.floor(local), 0), len(points) - degree - 1)
    jet = span_jet(points, span, matrix, min(1.0, max(0.0, local - span)))
    return jet.x, jet.y, jet.dx, jet.dy
