"""Curves as polylines that keep within a tolerance of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.exchange.selection import SelectedLevel
from bsmap_cli.geometry.se2 import Points
from bsmap_cli.mapping.sampling import evaluate

TOLERANCE_M = 0.001
LEAST_TOLERANCE_M = 1e-6  # what is written is rounded to no less


def polylines(selected: SelectedLevel, tolerance_m: float = TOLERANCE_M) -> list[Points]:
    """One polyline for each piece, as few vertices as keep it within `tolerance_m` of the curve."""
    level, pieces = selected.level, selected.pieces
    tolerance_m = max(tolerance_m, LEAST_TOLERANCE_M)
    begin, piece = _intervals(selected, 0.5 * tolerance_m)
    points, _ = evaluate(level, pieces.curve[piece], begin)
    last, _ = evaluate(level, pieces.curve, pieces.end)
    ends = np.cumsum(np.bincount(piece, minlength=len(pieces.curve)))
    split = np.split(points, ends[:-1])
    return [
        simplified(np.concatenate((line, last[k : k + 1])), 0.5 * tolerance_m)
        for k, line in enumerate(split[: len(pieces.curve)])
    ]


def spans_of(
    selected: SelectedLevel,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Piece, span and the part [u, u] of the span that is drawn, for all spans of all pieces."""
    pieces = selected.pieces
    first = np.floor(pieces.start + 1e-9).astype(np.int64)
    count = np.maximum(np.ceil(pieces.end - 1e-9).astype(np.int64) - first, 1)
    piece = np.repeat(np.arange(len(count)), count)
    span = first[piece] + np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
    begin = np.maximum(span, pieces.start[piece])
    end = np.minimum(span + 1, pieces.end[piece])
    return piece, span, begin, end


def _intervals(
    selected: SelectedLevel, tolerance_m: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Where each chord begins [u], and its piece.

    A chord over h strays by h^2 / 8 times |s''| at most; on a span s'' is a mean of the second
    differences of its control points.
    """
    level = selected.level
    piece, span, begin, end = spans_of(selected)
    row = level.offsets()[selected.pieces.curve[piece]] + span
    points = level.control_points.astype(np.float64)
    bend = np.zeros(len(points))
    second = points[2:] - 2.0 * points[1:-1] + points[:-2]
    bend[: len(second)] = np.hypot(second[:, 0], second[:, 1])
    most = np.zeros(len(row))
    for a in range(level.degree - 1):
        most = np.maximum(most, bend[row + a])
    count = np.ceil((end - begin) * np.sqrt(most / (8.0 * tolerance_m))).astype(np.int64)
    count = np.maximum(count, 1)
    source = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(source)) - np.repeat(np.cumsum(count) - count, count)
    width = (end - begin)[source] / count[source]
    return begin[source] + number * width, piece[source]


def simplified(line: Points, tolerance_m: float) -> Points:
    """The polyline without the vertices it can miss (Ramer, Douglas and Peucker)."""
    keep = np.zeros(len(line), bool)
    keep[[0, -1]] = True
    stack = [(0, len(line) - 1)]
    while stack:
        first, last = stack.pop()
        if last - first < 2:
            continue
        way = line[last] - line[first]
        offset = line[first + 1 : last] - line[first]
        square = float(way @ way)
        along = np.clip(offset @ way / square, 0.0, 1.0) if square > 0.0 else np.zeros(len(offset))
        off = offset - along[:, None] * way
        distance = np.hypot(off[:, 0], off[:, 1])
        worst = int(distance.argmax())
        if distance[worst] > tolerance_m:
            middle = first + 1 + worst
            keep[middle] = True
            stack += [(first, middle), (middle, last)]
    return line[keep]
