"""What rays meet first on a map: they walk from cell to cell (Amanatides and Woo 1987)."""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.geometry.compiled import inlined, lean
from bsmap_cli.geometry.kernels import polynomial_jet
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.drawn_grid import CHORDS, DrawnGrid, Integers, load, scratch


@inlined
def _meet_span(
    grid: DrawnGrid,
    item: int,
    x: float,
    y: float,
    cos: float,
    sin: float,
    polynomial: Points,
    buffer: Points,
) -> float:
    """Distance along a ray to the chords of a span, inf where it meets none."""
    load(grid, grid.spans[item, 0], polynomial, buffer)
    begin, end = grid.parts[item]
    nearest = math.inf
    ax, ay, _, _, _, _ = polynomial_jet(polynomial, begin)
    for k in range(1, CHORDS + 1):
        share = k / CHORDS
        bx, by, _, _, _, _ = polynomial_jet(polynomial, (1.0 - share) * begin + share * end)
        along_x, along_y = bx - ax, by - ay
        cross = cos * along_y - sin * along_x
        if cross != 0.0:
            reach = ((ax - x) * along_y - (ay - y) * along_x) / cross
            share = ((ax - x) * sin - (ay - y) * cos) / cross
            if reach >= 0.0 and 0.0 <= share <= 1.0 and reach < nearest:
                nearest = reach
        ax, ay = bx, by
    return nearest


@lean
def _cast(  # noqa: PLR0912
    grid: DrawnGrid,
    origins: Points,
    angles: Vector,
    range_max_m: float,
    polynomial: Points,
    buffer: Points,
    ranges: Vector,
    hits: Integers,
) -> None:
    """Range [m] and piece of the first chord that each ray meets; inf and -1 where none."""
    side = grid.cell_m
    for index in range(len(angles)):
        ranges[index], hits[index] = math.inf, -1
        x, y = origins[index, 0] - grid.origin[0], origins[index, 1] - grid.origin[1]
        cos, sin = math.cos(angles[index]), math.sin(angles[index])
        enter, leave = 0.0, range_max_m
        for start, ahead, size in ((x, cos, grid.columns * side), (y, sin, grid.rows * side)):
            if ahead == 0.0:
                if start < 0.0 or start > size:
                    leave = -1.0
            else:
                near, far = -start / ahead, (size - start) / ahead
                enter, leave = max(enter, min(near, far)), min(leave, max(near, far))
        if enter > leave:
            continue
        column = min(max(math.floor((x + enter * cos) / side), 0), grid.columns - 1)
        row = min(max(math.floor((y + enter * sin) / side), 0), grid.rows - 1)
        step_x, step_y = (1 if cos > 0.0 else -1), (1 if sin > 0.0 else -1)
        per_column = side / abs(cos) if cos != 0.0 else math.inf
        per_row = side / abs(sin) if sin != 0.0 else math.inf
        leave_x = ((column + (step_x > 0)) * side - x) / cos if cos != 0.0 else math.inf
        leave_y = ((row + (step_y > 0)) * side - y) / sin if sin != 0.0 else math.inf
        while True:
            cell = row * grid.columns + column
            for k in range(grid.starts[cell], grid.starts[cell + 1]):
                item = grid.items[k]
                reach = _meet_span(
                    grid,
                    item,
                    origins[index, 0],
                    origins[index, 1],
                    cos,
                    sin,
                    polynomial,
                    buffer,
                )
                if reach < ranges[index]:
                    ranges[index], hits[index] = reach, grid.spans[item, 1]
            crossing = min(leave_x, leave_y)
            if ranges[index] <= crossing or crossing > leave:
                break
            if leave_x < leave_y:
                column += step_x
                leave_x += per_column
            else:
                row += step_y
                leave_y += per_row
            if not (0 <= column < grid.columns and 0 <= row < grid.rows):
                break
        if ranges[index] > range_max_m:
            ranges[index], hits[index] = math.inf, -1


def cast(
    grid: DrawnGrid, origins: Points, angles_rad: Vector, range_max_m: float
) -> tuple[Vector, Integers]:
    """Range [m] and piece of the first chord each of (m,) rays meets; inf and -1 where none."""
    ranges, hits = np.empty(len(origins)), np.empty(len(origins), np.int64)
    angles = np.ascontiguousarray(angles_rad, np.float64)
    starts = np.ascontiguousarray(origins, np.float64)
    _cast(grid, starts, angles, float(range_max_m), *scratch(grid), ranges, hits)
    return ranges, hits
