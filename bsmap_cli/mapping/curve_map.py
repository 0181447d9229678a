"""The map while it grows: one set of arrays for each knot step of the ladder."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.geometry.compiled import lean
from bsmap_cli.geometry.curve import Curve
from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.mapping.centroid_tracking import Tracks
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.span_index import EMPTY, insert_span, remove_span

USABLE_WEIGHT = 0.02  # of all control points of a span that is matched against: the last full span


def _empty_level(curves: int, rows: int, cells: int) -> LevelArrays:
    names = ("first", "count", "offset", "low", "high", "seen")
    return LevelArrays(
        sizes=np.zeros(4, np.int64),
        **{name: np.zeros(curves, np.int64) for name in names},
        support=np.zeros((curves, 2)),
        points=np.zeros((rows, 2)),
        weights=np.zeros(rows),
        owner=np.full(rows, -1),
        spans=np.zeros((rows, 4)),
        next_span=np.full(rows, -1),
        span_cell=np.full(rows, -1),
        cell_keys=np.full(cells, EMPTY),
        cell_heads=np.full(cells, -1),
    )


@lean
def refresh_spans(
    level: LevelArrays, matrix: Points, knot_step_m: float, curve: int, begin: int, end: int
) -> None:
    """Index anew the spans of a curve that touch its rows `begin` .. `end` - 1."""
    degree = matrix.shape[0] - 1
    offset, count = level.offset[curve], level.count[curve]
    first = max(offset, begin - degree)
    for row in range(first, min(offset + count - degree, end)):
        span_u = float(level.first[curve] + degree + row - offset)
        usable = span_u < level.support[curve, 1] and span_u + 1.0 > level.support[curve, 0]
        for a in range(degree + 1):
            usable = usable and level.weights[row + a] >= USABLE_WEIGHT
        if not usable:
            remove_span(level, row)
            continue
        x0 = y0 = x1 = y1 = 0.0
        for a in range(degree):  # at a knot the last basis function of a span is zero
            x0 += matrix[a, 0] * level.points[row + a, 0]
            y0 += matrix[a, 0] * level.points[row + a, 1]
            x1 += matrix[a, 0] * level.points[row + 1 + a, 0]
            y1 += matrix[a, 0] * level.points[row + 1 + a, 1]
        level.spans[row, 0] = 0.5 * (x0 + x1)
        level.spans[row, 1] = 0.5 * (y0 + y1)
        level.spans[row, 2] = 0.5 * (x1 - x0)
        level.spans[row, 3] = 0.5 * (y1 - y0)
        insert_span(level, row, knot_step_m)


@lean
def _reindex(level: LevelArrays, matrix: Points, knot_step_m: float) -> None:
    """Fill an empty hash with all usable spans."""
    level.sizes[2] = 0
    for row in range(len(level.span_cell)):
        level.span_cell[row] = -1
    for curve in range(level.sizes[0]):
        begin = level.offset[curve]
        refresh_spans(level, matrix, knot_step_m, curve, begin, begin + level.count[curve])


class CurveMap:
    """All curves of one knot step; frame: the one in which curves were inserted.

    The state is `arrays`; kernels write into it. `reserve` makes room before they run.
    tracks : the clusters of the last scan, where they are tracked by their centroids.
    folded : there is no index of the spans for now, see `fold`.
    """

    def __init__(self, knot_step_m: float, degree: int, *, rows: int = 1024) -> None:
        self.knot_step_m = knot_step_m
        self.degree = degree
        self.matrix = basis_matrix(degree)
        self.arrays = _empty_level(64, rows, 2048)
        self.tracks: Tracks | None = None
        self.folded = False

    def __setstate__(self, state: dict[str, Any]) -> None:
        """As it was in another process; the matrix is that of this one, which cannot be written."""
        self.__dict__.update(state, matrix=basis_matrix(state["degree"]))

    def __len__(self) -> int:
        return int(self.arrays.sizes[0])

    def curve(self, index: int) -> Curve:
        """One curve as it stands: a copy."""
        arrays, step = self.arrays, self.knot_step_m
        rows = slice(int(arrays.offset[index]), int(arrays.offset[index] + arrays.count[index]))
        return Curve(
            degree=self.degree,
            knot_step_m=step,
            first_index=int(arrays.first[index]),
            control_points=arrays.points[rows].copy(),
            weights=arrays.weights[rows].copy(),
            tau_start_m=float(arrays.support[index, 0]) * step,
            tau_end_m=float(arrays.support[index, 1]) * step,
        )

    def reserve(self, rows: int) -> None:
        """Make room for `rows` further control points, as many spans and one more curve."""
        arrays = self.arrays
        have = len(arrays.weights)
        if arrays.sizes[1] + rows > have:
            new = max(2 * have, int(arrays.sizes[1]) + rows)
            arrays = arrays._replace(
                points=np.resize(arrays.points, (new, 2)),
                weights=_grown(arrays.weights, new, 0),
                owner=_grown(arrays.owner, new, -1),
                spans=np.resize(arrays.spans, (new, 4)),
                next_span=_grown(arrays.next_span, new, -1),
                span_cell=_grown(arrays.span_cell, new, -1),
            )
        if arrays.sizes[0] + 1 >= len(arrays.first):
            new = 2 * len(arrays.first)
            names = ("first", "count", "offset", "low", "high", "seen")
            arrays = arrays._replace(
                support=np.resize(arrays.support, (new, 2)),
                **{name: _grown(getattr(arrays, name), new, 0) for name in names},
            )
        crowded = 2 * (arrays.sizes[2] + rows) > len(arrays.cell_keys)
        if crowded:
            cells = _cells_for(int(arrays.sizes[2]) + rows)
            arrays = arrays._replace(cell_keys=np.full(cells, EMPTY), cell_heads=np.full(cells, -1))
        self.arrays = arrays
        if crowded:
            _reindex(arrays, self.matrix, self.knot_step_m)

    def trim(self) -> None:
        """Give back the room for control points to come; `reserve` makes it again."""
        self.fold()
        self.unfold()

    def fold(self) -> None:
        """Keep the curves alone, an eighth of the memory: none may look at it before `unfold`."""
        arrays, n = self.arrays, len(self)
        count = arrays.count[:n]
        ends = np.cumsum(count)
        total = int(count.sum())
        rows = np.arange(total) + np.repeat(arrays.offset[:n] - (ends - count), count)
        arrays.offset[:n] = arrays.low[:n] = ends - count
        arrays.high[:n] = ends
        arrays.sizes[1] = total
        none = np.empty(0, np.int64)
        columns = ("first", "count", "offset", "low", "high", "seen", "support")
        self.arrays = arrays._replace(
            **{name: getattr(arrays, name)[: n + 2].copy() for name in columns},
            points=arrays.points[rows],
            weights=arrays.weights[rows],
            owner=none,
            spans=np.empty((0, 4)),
            next_span=none,
            span_cell=none,
            cell_keys=none,
            cell_heads=none,
        )
        self.folded = True

    def unfold(self) -> None:
        """Index the spans again, the same way each time."""
        arrays, n = self.arrays, len(self)
        total, cells = len(arrays.weights), _cells_for(int(arrays.sizes[2]))
        self.arrays = arrays._replace(
            owner=np.repeat(np.arange(n), arrays.count[:n]),
            spans=np.zeros((total, 4)),
            next_span=np.full(total, -1),
            span_cell=np.full(total, -1),
            cell_keys=np.full(cells, EMPTY),
            cell_heads=np.full(cells, -1),
        )
        self.reindex()
        self.folded = False

    def moved(self, pose_new_old: SE2) -> CurveMap:
        """The same curves in another frame: exact, only the index is made anew."""
        arrays = self.arrays
        other = CurveMap(self.knot_step_m, self.degree)
        other.arrays = arrays._replace(
            **{name: getattr(arrays, name).copy() for name in arrays._fields if name != "points"},
            points=pose_new_old.transform(arrays.points),
        )
        other.reindex()
        return other

    def reindex(self) -> None:
        """Index all spans anew."""
        self.arrays.cell_keys[:] = EMPTY
        self.arrays.cell_heads[:] = -1
        _reindex(self.arrays, self.matrix, self.knot_step_m)


def _cells_for(count: int) -> int:
    """Size of a hash that holds so many cells and is not crowded: a power of two."""
    return 1 << math.ceil(math.log2(max(4 * count, 16)))


def _grown(array: np.ndarray, size: int, fill: int) -> np.ndarray:
    larger = np.full((size, *array.shape[1:]), fill, array.dtype)
    larger[: len(array)] = array
    return larger
