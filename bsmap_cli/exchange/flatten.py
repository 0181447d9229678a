"""Curves as polylines that keep within a tolerance of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.exchange.selection import SelectedLevel
from bsmap_cli.geometry.se2 import Points
from bsmap_cli.mapping.sampling import evaluate

TOLERANCE_M = 0.001
AT_ONCE = 1_000_000  # vertices
LEAST_TOLERANCE_M = 1e-6  # what is written is rounded to no less


def polylines(selected: SelectedLevel, tolerance_m: float = TOLERANCE_M) -> list[Points]:
    """One polyline for each piece, as few vertices as keep it within `tolerance_m` of the curve."""
    level, pieces = selected.level, selected.pieces
    tolerance_m = max(tolerance_m, LEAST_TOLERANCE_M)
    begin, piece = _intervals(selected, 0.5 * tolerance_m)
    points, _ = evaluate(level, pieces.curve[piece], begin)
    last, _ = evaluate(level, pieces.curve, pieces.end)
    counts = np.bincount(piece, minlength=len(pieces.curve)) + 1
    ends = np.cumsum(counts)
    vertices = np.empty((len(points) + len(last), 2))
    is_last = np.zeros(len(vertices), bool)
    is_last[ends - 1] = True
    vertices[~is_last], vertices[is_last] = points, last
    kept = _kept(vertices, ends - counts, ends - 1, 0.5 * tolerance_m)
    wanted = np.cumsum(np.add.reduceat(kept, ends - counts, dtype=np.int64)) if len(ends) else ends
    return np.split(vertices[kept], wanted[:-1])[: len(ends)]


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
    return line[_kept(line, np.array([0]), np.array([len(line) - 1]), tolerance_m)]


def _kept(
    vertices: Points, first: NDArray[np.int64], last: NDArray[np.int64], tolerance_m: float
) -> NDArray[np.bool_]:
    """Which vertices of many polylines are needed, from the first to the last one of each.

    Some lines at a time, to spare memory; all stretches of theirs at once, round by round.
    """
    keep = np.zeros(len(vertices), bool)
    keep[first] = keep[last] = True
    groups = np.searchsorted(last, np.arange(AT_ONCE, len(vertices), AT_ONCE))
    for stretches in zip(np.split(first, groups), np.split(last, groups), strict=True):
        begin, end = stretches
        while len(begin):
            begin, end = _split(vertices, begin, end, tolerance_m)
            keep[begin] = True
    return keep


def _split(
    vertices: Points, first: NDArray[np.int64], last: NDArray[np.int64], tolerance_m: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Both halves of each stretch whose vertices stray, cut at the one that strays most."""
    long = last - first >= 2
    first, last = first[long], last[long]
    inner = last - first - 1
    starts = np.cumsum(inner) - inner
    owner = np.repeat(np.arange(len(inner)), inner)
    index = np.arange(len(owner)) + np.repeat(first + 1 - starts, inner)
    way = vertices[last] - vertices[first]
    square = np.einsum("ki,ki->k", way, way)
    offset = vertices[index] - vertices[first[owner]]
    along = np.einsum("ki,ki->k", offset, way[owner]) / np.where(square > 0.0, square, 1.0)[owner]
    off = offset - np.clip(along, 0.0, 1.0)[:, None] * way[owner]
    distance = np.hypot(off[:, 0], off[:, 1])
    most = np.maximum.reduceat(distance, starts) if len(starts) else np.zeros(0)
    worst = np.flatnonzero((distance == most[owner]) & (distance > tolerance_m))
    strays, place = np.unique(owner[worst], return_index=True)
    middle = index[worst[place]]
    return np.concatenate((first[strays], middle)), np.concatenate((middle, last[strays]))
