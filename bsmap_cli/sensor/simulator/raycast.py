"""Exact ranges to segments and arcs: rays walk a uniform grid (Amanatides and Woo 1987)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, lean, lean_part
from bsmap_cli.geometry.se2 import Vector
from bsmap_cli.sensor.simulator.grid import Grid, grid_of
from bsmap_cli.sensor.simulator.world import Shapes

Ray = tuple[float, float, float, float]  # x, y [m], unit vector ahead
_ENDS = 1e-9  # of a segment's length: rays between two joined segments do not slip through


@inlined
def _to_segment(segment: Vector, ray: Ray) -> float:
    """Distance along the ray to the segment, inf where it misses; parallel rays miss."""
    x, y, ahead_x, ahead_y = ray
    along_x, along_y = segment[2] - segment[0], segment[3] - segment[1]
    off_x, off_y = segment[0] - x, segment[1] - y
    cross = ahead_x * along_y - ahead_y * along_x
    if cross * cross <= 1e-24 * (along_x * along_x + along_y * along_y):
        return math.inf
    distance = (off_x * along_y - off_y * along_x) / cross
    share = (off_x * ahead_y - off_y * ahead_x) / cross
    if distance <= 0.0 or share < -_ENDS or share > 1.0 + _ENDS:
        return math.inf
    return float(distance)


@inlined
def _to_arc(arc: Vector, ray: Ray) -> float:
    """Distance along the ray to the nearest point on the arc, inf where it misses."""
    x, y, ahead_x, ahead_y = ray
    off_x, off_y = arc[0] - x, arc[1] - y
    middle = ahead_x * off_x + ahead_y * off_y
    aside = ahead_x * off_y - ahead_y * off_x
    square = arc[2] * arc[2] - aside * aside
    if square < 0.0:
        return math.inf
    half_chord = math.sqrt(square)
    for distance in (middle - half_chord, middle + half_chord):
        if distance <= 0.0:
            continue
        angle = math.atan2(distance * ahead_y - off_y, distance * ahead_x - off_x) - arc[3]
        angle -= math.floor(angle / math.tau) * math.tau
        if angle <= arc[4] + _ENDS or angle >= math.tau - _ENDS:
            return float(distance)
    return math.inf


@inlined
def _entry(grid: Grid, ray: Ray) -> tuple[float, float]:
    """Distances at which the ray enters and leaves the grid; the first is larger: it misses."""
    x, y, ahead_x, ahead_y = ray
    enter, leave = 0.0, math.inf
    for start, ahead, low, cells in (
        (x, ahead_x, grid.origin[0], grid.columns),
        (y, ahead_y, grid.origin[1], grid.rows),
    ):
        high = low + cells * grid.cell_m
        if ahead == 0.0:
            if start < low or start > high:
                return 1.0, 0.0
            continue
        near, far = (low - start) / ahead, (high - start) / ahead
        enter, leave = max(enter, min(near, far)), min(leave, max(near, far))
    return enter, leave


@lean_part
def _first_hit(grid: Grid, ray: Ray, reach: float) -> float:
    """Distance to the first surface up to `reach`, else inf: cell after cell along the ray."""
    x, y, ahead_x, ahead_y = ray
    enter, leave = _entry(grid, ray)
    if enter > min(leave, reach):
        return math.inf
    side = grid.cell_m
    column = int((x + enter * ahead_x - grid.origin[0]) / side)
    row = int((y + enter * ahead_y - grid.origin[1]) / side)
    column, row = min(max(column, 0), grid.columns - 1), min(max(row, 0), grid.rows - 1)
    step_x, step_y = (1 if ahead_x > 0.0 else -1), (1 if ahead_y > 0.0 else -1)
    per_column = side / abs(ahead_x) if ahead_x != 0.0 else math.inf
    per_row = side / abs(ahead_y) if ahead_y != 0.0 else math.inf
    next_x = grid.origin[0] + (column + (step_x > 0)) * side
    next_y = grid.origin[1] + (row + (step_y > 0)) * side
    leave_x = (next_x - x) / ahead_x if ahead_x != 0.0 else math.inf
    leave_y = (next_y - y) / ahead_y if ahead_y != 0.0 else math.inf
    nearest = math.inf
    segment_count = len(grid.segments)
    while True:
        cell = row * grid.columns + column
        for index in range(grid.starts[cell], grid.starts[cell + 1]):
            item = grid.items[index]
            if item < segment_count:
                distance = _to_segment(grid.segments[item], ray)
            else:
                distance = _to_arc(grid.arcs[item - segment_count], ray)
            nearest = min(nearest, distance)
        crossing = min(leave_x, leave_y)
        if nearest <= crossing or crossing > reach:
            break
        if leave_x < leave_y:
            column += step_x
            leave_x += per_column
        else:
            row += step_y
            leave_y += per_row
        if column < 0 or column >= grid.columns or row < 0 or row >= grid.rows:
            break
    return nearest if nearest <= reach else math.inf


@lean
def cast_rays(
    grid: Grid, poses: NDArray[np.float64], angles: Vector, reach_m: float, ranges: Vector
) -> None:
    """Lower `ranges` [m] to the first surface that each ray meets within `reach_m`.

    poses : (1, 3) one for all rays, or (n, 3) one a ray: x, y [m], heading [rad], world frame.
    angles : (n,) direction of each ray from its pose [rad]. ranges : (n,) in and out.
    """
    for index in range(len(angles)):
        pose = poses[index if len(poses) > 1 else 0]
        direction = pose[2] + angles[index]
        ray = (pose[0], pose[1], math.cos(direction), math.sin(direction))
        ranges[index] = min(ranges[index], _first_hit(grid, ray, reach_m))


def ranges_to(shapes: Shapes, origin: Vector, angles: Vector, reach_m: float = math.inf) -> Vector:
    """(n,) range [m] from one point (2,) of the shapes' frame to them in each direction, or inf."""
    ranges = np.full(len(angles), math.inf)
    pose = np.array([[origin[0], origin[1], 0.0]])
    cast_rays(grid_of(shapes), pose, np.asarray(angles, np.float64), reach_m, ranges)
    return ranges
