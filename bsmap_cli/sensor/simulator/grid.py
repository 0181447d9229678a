"""Shapes sorted into the cells of a uniform grid, so that a ray meets only those on its way."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, lean
from bsmap_cli.geometry.se2 import Vector
from bsmap_cli.sensor.simulator.world import Shapes, Table

CELL_M = 0.5
MAX_CELLS = 4_000_000
_MARGIN_M = 1e-6  # a surface is also entered in cells that it misses by less


class Grid(NamedTuple):
    """Shapes and which cells they cross.

    segments, arcs : as in `Shapes`. origin : (2,) lower left corner [m].
    columns, rows : size in cells; cell (column, row) has the number row * columns + column.
    starts : (cells + 1,) int64, items : int32: items[starts[c]:starts[c + 1]] are the shapes in
    cell c, segments first, arcs counted on from there.
    """

    segments: Table
    arcs: Table
    origin: Vector
    cell_m: float
    columns: int
    rows: int
    starts: NDArray[np.int64]
    items: NDArray[np.int32]


def grid_of(shapes: Shapes, cell_m: float = CELL_M) -> Grid:
    """Sort shapes into cells; cells grow where the world is too large for them."""
    low, high = _bounds(shapes)
    size = np.maximum(high - low, _MARGIN_M)
    cell_m = max(cell_m, math.sqrt(float(size[0] * size[1]) / MAX_CELLS), float(size.max()) / 1e5)
    columns, rows = (int(count) for count in np.ceil(size / cell_m).astype(np.int64))
    counts = np.zeros(columns * rows + 1, np.int64)
    frame = (shapes.segments, shapes.arcs, low, cell_m, columns, rows)
    _sort_into_cells(Grid(*frame, counts, np.zeros(0, np.int32)), counts, True)
    starts = np.cumsum(counts)
    items = np.zeros(int(starts[-1]), np.int32)
    _sort_into_cells(Grid(*frame, starts, items), starts[:-1].copy(), False)
    return Grid(*frame, starts, items)


def single_cell(shapes: Shapes) -> Grid:
    """A grid of one cell: for few shapes that move."""
    low, high = _bounds(shapes)
    cell_m = max(float((high - low).max()), _MARGIN_M)
    starts = np.array([0, len(shapes)], np.int64)
    items = np.arange(len(shapes), dtype=np.int32)
    return Grid(shapes.segments, shapes.arcs, low, cell_m, 1, 1, starts, items)


def _bounds(shapes: Shapes) -> tuple[Vector, Vector]:
    """Corners of the box round all shapes, a little wider."""
    centres, radii = shapes.arcs[:, :2], shapes.arcs[:, 2:3]
    corners = (shapes.segments[:, :2], shapes.segments[:, 2:], centres - radii, centres + radii)
    points = np.concatenate(corners)
    if not len(points):
        return np.zeros(2), np.zeros(2)
    return points.min(axis=0) - 10 * _MARGIN_M, points.max(axis=0) + 10 * _MARGIN_M


@inlined
def _segment_meets_box(segment: Vector, low_x: float, low_y: float, side: float) -> bool:
    """Whether the segment's line passes the box; its extent is checked by the caller."""
    half = side / 2.0
    x, y = segment[0] - low_x - half, segment[1] - low_y - half
    along_x, along_y = segment[2] - segment[0], segment[3] - segment[1]
    distance = abs(along_x * y - along_y * x)
    reach = half * (abs(along_x) + abs(along_y))
    return bool(distance <= reach + _MARGIN_M * math.hypot(along_x, along_y))


@inlined
def _circle_meets_box(arc: Vector, low_x: float, low_y: float, side: float) -> bool:
    """Whether the whole circle of the arc passes the box."""
    half = side / 2.0
    x, y = abs(arc[0] - low_x - half), abs(arc[1] - low_y - half)
    nearest = math.hypot(max(x - half, 0.0), max(y - half, 0.0))
    farthest = math.hypot(x + half, y + half)
    return bool(nearest <= arc[2] + _MARGIN_M and farthest >= arc[2] - _MARGIN_M)


@lean
def _sort_into_cells(grid: Grid, cursor: NDArray[np.int64], only_count: bool) -> None:
    """Count the shapes of cell c in cursor[c + 1], or write them from cursor[c] on."""
    segment_count = len(grid.segments)
    for item in range(segment_count + len(grid.arcs)):
        if item < segment_count:
            x0, y0, x1, y1 = grid.segments[item]
            low_x, high_x, low_y, high_y = min(x0, x1), max(x0, x1), min(y0, y1), max(y0, y1)
        else:
            x, y, radius = grid.arcs[item - segment_count, :3]
            low_x, high_x, low_y, high_y = x - radius, x + radius, y - radius, y + radius
        first_column = max(0, int((low_x - _MARGIN_M - grid.origin[0]) / grid.cell_m))
        last_column = min(
            grid.columns - 1, int((high_x + _MARGIN_M - grid.origin[0]) / grid.cell_m)
        )
        first_row = max(0, int((low_y - _MARGIN_M - grid.origin[1]) / grid.cell_m))
        last_row = min(grid.rows - 1, int((high_y + _MARGIN_M - grid.origin[1]) / grid.cell_m))
        for row in range(first_row, last_row + 1):
            for column in range(first_column, last_column + 1):
                left = grid.origin[0] + column * grid.cell_m
                bottom = grid.origin[1] + row * grid.cell_m
                if item < segment_count:
                    meets = _segment_meets_box(grid.segments[item], left, bottom, grid.cell_m)
                else:
                    meets = _circle_meets_box(
                        grid.arcs[item - segment_count], left, bottom, grid.cell_m
                    )
                if not meets:
                    continue
                cell = row * grid.columns + column
                if only_count:
                    cursor[cell + 1] += 1
                else:
                    grid.items[cursor[cell]] = item
                    cursor[cell] += 1
