"""Curves as coloured polylines for 3D viewers: the more often seen, the stronger."""

from __future__ import annotations

from collections.abc import Iterator

from bsmap_cli.exchange.flatten import polylines
from bsmap_cli.exchange.selection import SelectedLevel
from bsmap_cli.geometry.se2 import Points

LINE_PIXELS = 2.0
PALE, STRONG = (0.55, 0.72, 0.85), (0.05, 0.25, 0.5)

Colour = tuple[float, float, float]  # red, green, blue, 0 to 1


def coloured_lines(
    selected: SelectedLevel, max_weight: int, tolerance_m: float
) -> Iterator[tuple[Points, Colour]]:
    """A polyline of each drawn piece, within `tolerance_m` of it, and the colour of its curve."""
    level = selected.level
    rows = level.offsets()
    lines = polylines(selected, tolerance_m)
    for curve, line in zip(selected.pieces.curve.tolist(), lines, strict=True):
        weights = level.weights[rows[curve] : rows[curve + 1]]
        share = min(float(weights[weights > 0].mean()) / max(max_weight, 1), 1.0)
        red, green, blue = (a + share * (b - a) for a, b in zip(PALE, STRONG, strict=True))
        yield line, (red, green, blue)
