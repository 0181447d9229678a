"""Which cells of a grid are seen from some places: rays until they meet a curve's free side."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector

RAYS = 480
FARTHEST_STEP = 12  # [cells] that a ray may leap through empty space
VIEW_SPACING = 30.0  # [cells]: nearer viewpoints add next to nothing
LARGEST_JUMP = 10.0  # [cells] between neighbouring rays that still see one surface

CELLS_AT_ONCE = 2**22  # of a grid: what is reckoned of them takes tens of bytes each


def visible_cells(facing: NDArray[np.uint8], views: Points, range_max: float) -> NDArray[np.bool_]:
    """(rows, columns) bool: cells between a viewpoint and a surface that faces it.

    facing : (rows, columns) bits, one for each octant of ray directions that meets the free side
    of a curve in the cell; 0 where no curve passes. views : (m, 2) column, row; range_max [cells].
    A ray that meets the back of a curve, or nothing, shows nothing.
    """
    views = _spread(views, facing.shape)
    ranges = _cast(facing, views, range_max).reshape(len(views), RAYS)
    return _fill(facing.shape, views, ranges)


def _spread(views: Points, shape: tuple[int, ...]) -> Points:
    """One viewpoint for each square of `VIEW_SPACING` cells, of those on the grid."""
    rows, columns = shape
    on_grid = ((views >= 0) & (views < [columns, rows])).all(axis=1)
    views = views[on_grid]
    squares = np.floor(views / VIEW_SPACING).astype(np.int64)
    _, first = np.unique(squares @ [1, columns + 1], return_index=True)
    return views[np.sort(first)]


def bands(shape: tuple[int, ...]) -> Iterator[tuple[int, int]]:
    """First and last row (exclusive) of parts of a grid that are worked on at once."""
    rows, columns = shape
    some = max(1, CELLS_AT_ONCE // max(columns, 1))
    return ((first, min(first + some, rows)) for first in range(0, rows, some))


def _clearance(facing: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Chessboard distance to the nearest cell that a curve passes, at most `FARTHEST_STEP`."""
    clearance = np.zeros(facing.shape, np.uint8)
    for first, last in bands(facing.shape):
        begin = max(first - FARTHEST_STEP, 0)
        reached = facing[begin : last + FARTHEST_STEP] != 0
        for _ in range(FARTHEST_STEP):
            clearance[first:last] += ~reached[first - begin : last - begin]
            grown = reached.copy()
            grown[1:] |= reached[:-1]
            grown[:-1] |= reached[1:]
            reached = grown.copy()
            reached[:, 1:] |= grown[:, :-1]
            reached[:, :-1] |= grown[:, 1:]
    return clearance


def _directions() -> Points:
    angle = (np.arange(RAYS) + 0.5) * (2.0 * np.pi / RAYS)
    return np.column_stack((np.cos(angle), np.sin(angle)))


def _cast(facing: NDArray[np.uint8], views: Points, range_max: float) -> Vector:
    """Range [cells] of every ray of every view; 0 where it shows nothing."""
    rows, columns = facing.shape
    clearance = _clearance(facing).ravel()
    ray = np.arange(len(views) * RAYS, dtype=np.int32)
    x, y = np.repeat(views, RAYS, axis=0).astype(np.float32).T.copy()
    dx, dy = np.tile(_directions().astype(np.float32), (len(views), 1)).T.copy()
    ranges, travelled = np.zeros(len(ray)), np.zeros(len(ray), np.float32)
    octant = (np.arange(RAYS) * 8 // RAYS).astype(np.uint8)
    while len(ray):
        cell = y.astype(np.int32) * columns + x.astype(np.int32)
        clear = clearance[cell]
        hit = np.flatnonzero(clear == 0)
        seen = (facing.ravel()[cell[hit]] >> octant[ray[hit] % RAYS]) & 1
        ranges[ray[hit]] = travelled[hit] * seen
        # a leap of one cell less than the clearance never enters an occupied cell
        leap = np.maximum(clear.astype(np.float32) - 1, np.float32(0.5))
        x, y, travelled = x + leap * dx, y + leap * dy, travelled + leap
        inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        alive = np.flatnonzero((clear > 0) & inside & (travelled <= range_max))
        ray, x, y = ray[alive], x[alive], y[alive]
        dx, dy, travelled = dx[alive], dy[alive], travelled[alive]
    return ranges


def _fill(shape: tuple[int, ...], views: Points, ranges: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Cells whose centre lies in the sector between two neighbouring rays of some view.

    The outlines of all sectors are laid over each other: a cell's winding number is the number
    of views that see it.
    """
    begin, end = ranges, np.roll(ranges, -1, axis=1)
    none = (begin == 0.0) | (end == 0.0)
    near = np.where(none, 0.0, np.minimum(begin, end))
    jump = none | (np.abs(begin - end) > LARGEST_JUMP)
    begin, end = np.where(jump, near, begin), np.where(jump, near, end)
    directions, after = _directions(), np.roll(_directions(), -1, axis=0)
    centre = views[:, None, :]
    a = centre + begin[..., None] * directions
    b = centre + end[..., None] * after
    next_a = centre + np.roll(begin, -1, axis=1)[..., None] * after
    starts = np.concatenate((a.reshape(-1, 2), b.reshape(-1, 2)))
    ends = np.concatenate((b.reshape(-1, 2), next_a.reshape(-1, 2)))
    return _inside(shape, starts, ends)


def _inside(shape: tuple[int, ...], starts: Points, ends: Points) -> NDArray[np.bool_]:
    """Cells round whose centre closed outlines wind, given by their edges."""
    inside = np.zeros(shape, bool)
    low = np.minimum(starts[:, 1], ends[:, 1])
    high = np.maximum(starts[:, 1], ends[:, 1])
    # rows whose centre is crossed
    begin = np.clip(np.ceil(low - 0.5), 0, shape[0]).astype(np.int64)
    end = np.clip(np.ceil(high - 0.5), 0, shape[0]).astype(np.int64)
    for first, last in bands(shape):
        edge = np.flatnonzero((begin < last) & (end > first))
        rows = np.maximum(begin[edge], first), np.minimum(end[edge], last)
        winding = _winding((last - first, shape[1]), starts[edge], ends[edge], rows, first)
        inside[first:last] = winding > 0
    return inside


def _winding(
    shape: tuple[int, ...],
    starts: Points,
    ends: Points,
    crossed: tuple[NDArray[np.int64], NDArray[np.int64]],
    first: int,
) -> NDArray[np.int32]:
    """Winding number round each cell's centre, in the rows from `first` on.

    crossed : first and last row (exclusive) that each edge crosses there.
    """
    rows, columns = shape
    count = crossed[1] - crossed[0]
    edge = np.repeat(np.arange(len(starts)), count)
    row = crossed[0][edge] + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    run, rise = (ends - starts)[edge].T
    crossing = starts[edge, 0] + (row + 0.5 - starts[edge, 1]) * run / rise
    # an edge counts for the cells to the left of where it crosses their row
    column = np.clip(np.ceil(crossing - 0.5), 0, columns).astype(np.int64)
    change = np.bincount(
        (row - first) * (columns + 1) + column, np.sign(rise), minlength=rows * (columns + 1)
    ).reshape(rows, columns + 1)
    from_right = np.cumsum(change[:, :0:-1], axis=1)[:, ::-1]
    return np.rint(from_right).astype(np.int32)
