"""Take control points out of curves: Algorithm 1 extends curve segments and removes them.

A control point that goes takes the d + 1 spans with it that it shapes. What is left of its curve
is shorter, or falls into several curves; what keeps its lattice indices keeps its shape exactly.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.mapping.centroid_tracking import Tracks
from bsmap_cli.mapping.curve_map import CurveMap, refresh_spans
from bsmap_cli.mapping.span_index import remove_span

Rows = NDArray[np.bool_]
Run = tuple[int, int]


def remove_points(curve_map: CurveMap, gone: Rows, *, min_length: float) -> None:
    """Remove the control points in the rows marked `gone`.

    The first part that is left of a curve keeps its index, further ones become new curves, and
    parts with less than `min_length` of data support [knot steps] go too.
    """
    owners = curve_map.arrays.owner[: len(gone)][gone]
    for curve in np.unique(owners[owners >= 0]).tolist():
        arrays = curve_map.arrays
        begin = int(arrays.offset[curve])
        end = begin + int(arrays.count[curve])
        if gone[begin:end].any():
            _divide(curve_map, curve, _remaining(gone, begin, end), min_length)


def remove_guessed(curve_map: CurveMap, *, min_length: float) -> None:
    """Cut curves where they only pass from one measured stretch to another.

    Beams that may have been lost, or a door seen at a grazing angle, leave a curve that crosses an
    opening. Where nothing else was measured on it, the control points there kept hardly any weight.
    """
    arrays, degree = curve_map.arrays, curve_map.degree
    gone = np.zeros(int(arrays.sizes[1]), bool)
    for curve in range(len(curve_map)):
        begin = int(arrays.offset[curve])
        spans = int(arrays.count[curve]) - degree
        measured = np.flatnonzero(arrays.span_cell[begin : begin + spans] >= 0).tolist()
        for before, behind in pairwise([-1, *measured, spans]):
            gone[begin + before + degree + 1 : begin + behind] = True
    remove_points(curve_map, gone, min_length=min_length)


def _remaining(gone: Rows, begin: int, end: int) -> list[Run]:
    """Runs of rows, first and end, that are not gone."""
    kept = np.concatenate(([False], ~gone[begin:end], [False]))
    edges = begin + np.flatnonzero(kept[1:] != kept[:-1])
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _divide(curve_map: CurveMap, curve: int, runs: list[Run], min_length: float) -> None:
    """Leave of a curve the runs of rows that still carry one; each keeps its rows."""
    arrays, degree = curve_map.arrays, curve_map.degree
    first, offset = int(arrays.first[curve]), int(arrays.offset[curve])
    end, high = offset + int(arrays.count[curve]), int(arrays.high[curve])
    start_u, end_u = arrays.support[curve].tolist()
    for row in range(offset, end):
        remove_span(arrays, row)
    parts = []
    for low, stop in runs:
        least_u = max(start_u, float(first + low - offset + degree))
        most_u = min(end_u, float(first + stop - offset))
        if stop - low > degree and most_u - least_u >= min_length:
            parts.append((low, stop, least_u, most_u))
    arrays.count[curve] = 0
    pieces: list[int] = []
    for k, (low, stop, least_u, most_u) in enumerate(parts):
        piece = curve if k == 0 else _new_curve(curve_map, like=curve)
        arrays = curve_map.arrays
        if k > 0:
            arrays.high[pieces[-1]] = arrays.low[piece] = low
        arrays.high[piece] = high
        arrays.first[piece] = first + low - offset
        arrays.count[piece] = stop - low
        arrays.offset[piece] = low
        arrays.support[piece] = least_u, most_u
        arrays.owner[int(arrays.low[piece]) : high] = piece
        pieces.append(piece)
    for piece in pieces:
        low = int(arrays.offset[piece])
        stop = low + int(arrays.count[piece])
        refresh_spans(arrays, curve_map.matrix, curve_map.knot_step_m, piece, low, stop)
    _follow(curve_map, curve, pieces)


def _new_curve(curve_map: CurveMap, *, like: int) -> int:
    """Index of a further curve that was seen as often as another."""
    curve_map.reserve(0)
    arrays = curve_map.arrays
    curve = int(arrays.sizes[0])
    arrays.sizes[0] += 1
    arrays.seen[curve] = arrays.seen[like]
    return curve


def _follow(curve_map: CurveMap, curve: int, pieces: list[int]) -> None:
    """Let clusters tracked along a curve go on along the piece that holds their start."""
    tracks = curve_map.tracks
    if tracks is None:
        return
    curves = tracks.curves.copy()
    for k in np.flatnonzero(tracks.curves == curve):
        u = tracks.starts_m[k] / curve_map.knot_step_m
        apart = [float(np.abs(curve_map.arrays.support[p] - u).min()) for p in pieces]
        curves[k] = pieces[int(np.argmin(apart))] if pieces else -1
    kept = curves >= 0
    curve_map.tracks = Tracks(tracks.centroids[kept], curves[kept], tracks.starts_m[kept])
