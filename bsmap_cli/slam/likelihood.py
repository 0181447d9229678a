"""What a submap looks like to a search: how likely a surface of each direction is at each cell.

Four channels hold surfaces running towards east, north, west and south (each within 67.5
degrees), so that the two sides of a corridor, or of a thin wall, are never taken for one another.
Above the finest grid stands a pyramid: height h holds, at each cell, the largest value in the
2^h x 2^h cells towards higher x and y, a bound for a whole block of translations.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import kernel, lean
from bsmap_cli.geometry.foot_points import span_jet
from bsmap_cli.geometry.kernels import magnitude
from bsmap_cli.geometry.se2 import Points
from bsmap_cli.mapping.curve_map import CurveMap

Grid = NDArray[np.uint8]
Row = NDArray[np.uint8]

CHANNELS = 4
REACH_CELLS = 3  # how far round a surface a cell is likely at all
SPREAD_CELLS = 1.2  # deviation of the likelihood


@dataclass(frozen=True, slots=True)
class Likelihood:
    """grids : (heights, 4, rows, columns) uint8; origin_m : (2,) corner of cell (0, 0); cell_m."""

    grids: Grid
    origin_m: NDArray[np.float64]
    cell_m: float


def sample_surfaces(curve_map: CurveMap, spacing_m: float) -> tuple[Points, Points]:
    """(n, 2) points [m] and (n, 2) directions along all indexed spans of a level."""
    arrays = curve_map.arrays
    rows = np.flatnonzero(arrays.span_cell[: arrays.sizes[1]] >= 0)
    per_span = max(1, math.ceil(curve_map.knot_step_m / spacing_m))
    points = np.empty((len(rows) * per_span, 2))
    directions = np.empty_like(points)
    _sample(arrays.points, rows, curve_map.matrix, per_span, points, directions)
    return points, directions


@lean
def _sample(
    control_points: Points,
    rows: NDArray[np.int64],
    matrix: Points,
    per_span: int,
    points: Points,
    directions: Points,
) -> None:
    n = 0
    for row in rows:
        for k in range(per_span):
            jet = span_jet(control_points, row, matrix, (k + 0.5) / per_span)
            norm = magnitude(jet.dx, jet.dy) + 1e-300
            points[n, 0], points[n, 1] = jet.x, jet.y
            directions[n, 0], directions[n, 1] = jet.dx / norm, jet.dy / norm
            n += 1


@kernel
def _stamp(points: Points, directions: Points, cell_m: float, grid: Grid) -> None:
    """Write each surface sample into the channels of its direction; points relative to the grid."""
    side = 2 * REACH_CELLS + 1
    across, up = np.empty(side), np.empty(side)
    for i in range(len(points)):
        x, y = points[i, 0] / cell_m, points[i, 1] / cell_m
        column, row = math.floor(x), math.floor(y)
        for a in range(side):
            dx, dy = column + a - REACH_CELLS + 0.5 - x, row + a - REACH_CELLS + 0.5 - y
            across[a] = math.exp(-0.5 * (dx / SPREAD_CELLS) ** 2)
            up[a] = 255.0 * math.exp(-0.5 * (dy / SPREAD_CELLS) ** 2)
        for channel in range(CHANNELS):
            along = directions[i, channel & 1] * (1.0 if channel < 2 else -1.0)
            if along < 0.3826834323650898:  # cos 67.5 degrees
                continue
            for a in range(side):
                for b in range(side):
                    r, c = row + a - REACH_CELLS, column + b - REACH_CELLS
                    grid[channel, r, c] = max(grid[channel, r, c], np.uint8(up[a] * across[b]))


def _fill_pyramid(grids: Grid) -> None:
    """Fill heights 1 .. from height 0: the maximum over windows that double in size.

    What a window takes from beyond the end of its row, or of its channel, it finds at the beginning
    of the next, which is empty there.
    """
    columns = grids.shape[3]
    planes = grids.reshape(len(grids), -1)
    taller = np.empty_like(planes[0])
    for h in range(1, len(grids)):
        half = 1 << (h - 1)
        _larger(planes[h - 1], half * columns, taller)
        _larger(taller, half, planes[h])


def _larger(values: Row, ahead: int, larger: Row) -> None:
    """The larger of each value and the one so far ahead."""
    np.maximum(values[:-ahead], values[ahead:], out=larger[:-ahead])
    larger[-ahead:] = values[-ahead:]


def build_likelihood(curve_map: CurveMap, *, cell_m: float, heights: int) -> Likelihood:
    """The likelihood pyramid of one level of a submap, in the submap's frame."""
    points, directions = sample_surfaces(curve_map, 0.5 * cell_m)
    margin = (REACH_CELLS + 2) * cell_m
    if len(points) == 0:
        points, directions = np.zeros((1, 2)), np.array([[1.0, 0.0]])
    origin = np.floor((points.min(axis=0) - margin) / cell_m) * cell_m
    # windows towards higher indices look back over the lower edge: pad by the widest one
    origin = origin - cell_m * (1 << (heights - 1))
    columns, rows = (np.ceil((points.max(axis=0) + margin - origin) / cell_m) + 1).astype(int)
    grids = np.empty((heights, CHANNELS, rows, columns), np.uint8)
    grids[0] = 0
    _stamp(points - origin, directions, cell_m, grids[0])
    _fill_pyramid(grids)
    return Likelihood(grids, origin, cell_m)
