"""Cut the clusters of a scan into runs: what goes into which map curve.

A run is a stretch of neighbouring points of one cluster that belong to one curve. Points beyond
the end of a curve extend it by arc length, never by projection; a stretch that meets nothing and
is long enough becomes a curve of its own.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, lean, lean_part
from bsmap_cli.geometry.kernels import magnitude
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.least_surface import LeastSurface, is_surface
from bsmap_cli.mapping.level_arrays import LevelArrays

END_REACH = 3.0  # a run that comes this close to a curve's end may extend it [knot steps]

# columns of a run: curve (-1: new), first point, end, first and end of its matched points
CURVE, BEGIN, END, KNOWN_BEGIN, KNOWN_END = range(5)


@lean_part
def _stretch_length(points: Points, begin: int, end: int) -> float:
    length = 0.0
    for j in range(begin + 1, end):
        length += magnitude(points[j, 0] - points[j - 1, 0], points[j, 1] - points[j - 1, 1])
    return length


@inlined
def _same_run(u: Vector, points: Points, last: int, j: int, knot_step_m: float) -> bool:
    """Does matched point j go on where `last` was: forward by about the way between them?"""
    way = magnitude(points[j, 0] - points[last, 0], points[j, 1] - points[last, 1]) / knot_step_m
    advance = u[j] - u[last]
    return bool(-0.5 <= advance <= 1.5 * way + 0.5)


@lean_part
def _matched_runs(
    curves: NDArray[np.int64],
    u: Vector,
    points: Points,
    begin: int,
    end: int,
    knot_step_m: float,
    runs: NDArray[np.int64],
    count: int,
) -> int:
    """Append the runs of matched points of one cluster; short misses inside a run are bridged."""
    first = count
    last = begin - 1
    for j in range(begin, end):
        if curves[j] < 0:
            continue
        bridged = (
            count > first
            and runs[count - 1, CURVE] == curves[j]
            and _same_run(u, points, last, j, knot_step_m)
            and _stretch_length(points, last, j + 1) < 2.0 * knot_step_m + 1e-9
        )
        if count > first and runs[count - 1, CURVE] == curves[j] and j == last + 1:
            bridged = _same_run(u, points, last, j, knot_step_m)
        if bridged:
            runs[count - 1, END] = j + 1
        else:
            runs[count, CURVE] = curves[j]
            runs[count, BEGIN] = j
            runs[count, END] = j + 1
            count += 1
        last = j
    for r in range(first, count):
        runs[r, KNOWN_BEGIN] = runs[r, BEGIN]
        runs[r, KNOWN_END] = runs[r, END]
    return int(count)


@lean
def plan_runs(
    level: LevelArrays,
    points: Points,
    starts: NDArray[np.int64],
    curves: NDArray[np.int64],
    u: Vector,
    knot_step_m: float,
    least: LeastSurface,
    runs: NDArray[np.int64],
) -> int:
    """Write the runs of all clusters; their number. See the column names above."""
    count: Any = np.int64(0)  # 0 as a literal would be compiled for itself
    for c in range(len(starts) - 1):
        begin, end = starts[c], starts[c + 1]
        first = count
        count = _matched_runs(curves, u, points, begin, end, knot_step_m, runs, count)
        matched = count
        cursor = begin
        for r in range(first, matched + 1):
            stop = runs[r, KNOWN_BEGIN] if r < matched else end
            if stop > cursor:
                before = r - 1 if r > first else -1
                after = r if r < matched else -1
                if before >= 0:
                    curve = runs[before, CURVE]
                    edge = u[runs[before, KNOWN_END] - 1]
                    if edge < level.support[curve, 1] - END_REACH:
                        before = -1
                if before < 0 and after >= 0:
                    curve = runs[after, CURVE]
                    edge = u[runs[after, KNOWN_BEGIN]]
                    if edge > level.support[curve, 0] + END_REACH:
                        after = -1
                if before >= 0:
                    runs[before, END] = stop
                elif after >= 0:
                    runs[after, BEGIN] = cursor
                elif is_surface(stop - cursor, _stretch_length(points, cursor, stop), least):
                    runs[count, CURVE] = -1
                    runs[count, BEGIN] = cursor
                    runs[count, END] = stop
                    runs[count, KNOWN_BEGIN] = cursor
                    runs[count, KNOWN_END] = cursor
                    count += 1
            if r < matched:
                cursor = runs[r, KNOWN_END]
    return int(count)
