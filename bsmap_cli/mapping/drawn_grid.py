"""The drawn spans of a finished level in the cells of a grid: a question asks those on its way."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.geometry.compiled import inlined, lean
from bsmap_cli.geometry.kernels import polynomial_jet, span_polynomial
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.map_document import MapLevel
from bsmap_cli.mapping.sampling import DrawnPieces

CHORDS = 8  # of a span: they stray from it by about 2e-3 of the knot step
CELL_STEPS = 2.0
CELLS_PER_SPAN = 4.0  # more cells than that are never made: they are wider instead

Integers = NDArray[np.int64]


class DrawnGrid(NamedTuple):
    """Drawn spans, or the drawn part of them, and the cells that they touch.

    control : (N, 2) float32; matrix : (d + 1, d + 1).
    spans : (S, 2) int64, row of the first control point, and piece.
    parts : (S, 2) drawn part of the span, within 0 .. 1.
    pieces : (P, 3) first row of the piece's curve, first and last u [knot steps].
    starts, items : cell (column, row) has the number c = row * columns + column, and
        items[starts[c]:starts[c + 1]] are the spans that touch it.
    """

    control: NDArray[np.float32]
    matrix: Points
    spans: Integers
    parts: Points
    pieces: Points
    origin: Vector
    cell_m: float
    columns: int
    rows: int
    starts: Integers
    items: NDArray[np.int32]


def draw_grid(level: MapLevel, pieces: DrawnPieces) -> DrawnGrid:
    """Sort the drawn spans of a level into cells."""
    first_row = level.offsets()[pieces.curve]
    begin, end = np.floor(pieces.start).astype(np.int64), np.ceil(pieces.end).astype(np.int64)
    piece = np.repeat(np.arange(len(begin)), end - begin)
    starts = np.cumsum(end - begin) - (end - begin)
    span = begin[piece] + np.arange(len(piece)) - starts[piece]
    parts = np.stack(
        (
            np.maximum(pieces.start[piece] - span, 0.0),
            np.minimum(pieces.end[piece] - span, 1.0),
        ),
        axis=1,
    )
    control = np.require(level.control_points, np.float32, ["C", "A"]).view()
    control.flags.writeable = False  # as in a map that was read: one type to compile for
    # a span lies within the box of its control points
    low, high = np.zeros(2), np.full(2, level.knot_step_m)
    if len(control):
        low, high = control.min(axis=0).astype(float), control.max(axis=0).astype(float)
    size = np.maximum(high - low, level.knot_step_m)
    most = CELLS_PER_SPAN * max(len(span), 1)
    cell_m = max(CELL_STEPS * level.knot_step_m, math.sqrt(float(size[0] * size[1]) / most))
    cell_m = max(cell_m, float(size.max()) / most)
    columns, rows = (int(count) + 1 for count in size // cell_m)
    grid = DrawnGrid(
        control=control,
        matrix=basis_matrix(level.degree).copy(),
        spans=np.stack((first_row[piece] + span, piece), axis=1),
        parts=parts,
        pieces=np.stack((first_row, pieces.start, pieces.end), axis=1).astype(np.float64),
        origin=low,
        cell_m=cell_m,
        columns=columns,
        rows=rows,
        starts=np.zeros(columns * rows + 1, np.int64),
        items=np.zeros(0, np.int32),
    )
    polynomial, buffer = scratch(grid)
    _fill(grid, polynomial, buffer, grid.starts[1:], True)
    np.cumsum(grid.starts, out=grid.starts)
    grid = grid._replace(items=np.zeros(int(grid.starts[-1]), np.int32))
    _fill(grid, polynomial, buffer, grid.starts[:-1].copy(), False)
    return grid


def scratch(grid: DrawnGrid) -> tuple[Points, Points]:
    """What `load` writes into: polynomial and buffer."""
    order = len(grid.matrix)
    return np.zeros((order, 2)), np.zeros((order, 2))


@inlined
def load(grid: DrawnGrid, row: int, polynomial: Points, buffer: Points) -> None:
    """The polynomial of the span whose first control point is in `row`."""
    for k in range(len(buffer)):
        buffer[k, 0] = grid.control[row + k, 0]
        buffer[k, 1] = grid.control[row + k, 1]
    span_polynomial(buffer, 0, grid.matrix, polynomial)


@lean
def _fill(
    grid: DrawnGrid, polynomial: Points, buffer: Points, cursor: Integers, only_count: bool
) -> None:
    """Count the spans that touch cell c in cursor[c], or write them from cursor[c] on."""
    for item in range(len(grid.spans)):
        load(grid, grid.spans[item, 0], polynomial, buffer)
        low_x = low_y = math.inf
        high_x = high_y = -math.inf
        begin, end = grid.parts[item]
        for k in range(CHORDS + 1):
            share = k / CHORDS
            x, y, _, _, _, _ = polynomial_jet(polynomial, (1.0 - share) * begin + share * end)
            low_x, high_x = min(low_x, x), max(high_x, x)
            low_y, high_y = min(low_y, y), max(high_y, y)
        margin = 1e-6  # a cell's edge belongs to both sides
        first_column = math.floor((low_x - grid.origin[0]) / grid.cell_m - margin)
        last_column = math.floor((high_x - grid.origin[0]) / grid.cell_m + margin)
        first_row = math.floor((low_y - grid.origin[1]) / grid.cell_m - margin)
        last_row = math.floor((high_y - grid.origin[1]) / grid.cell_m + margin)
        for row in range(max(first_row, 0), min(last_row, grid.rows - 1) + 1):
            for column in range(max(first_column, 0), min(last_column, grid.columns - 1) + 1):
                cell = row * grid.columns + column
                if not only_count:
                    grid.items[cursor[cell]] = item
                cursor[cell] += 1
