"""Give the points of each run their parameters and merge run by run: Algorithm 1, line 4.1.2."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, kernel, lean_part, part
from bsmap_cli.geometry.kernels import magnitude
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.control_points import FitRoom, fit_room, solve_fit
from bsmap_cli.mapping.fitting import (
    arc_length_parameters,
    lattice_domain,
    least_and_greatest,
    spacing_weights,
)
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.merging import has_room, merge_run
from bsmap_cli.mapping.runs import BEGIN, CURVE, END, KNOWN_BEGIN, KNOWN_END


@inlined
def _advance(points: Points, tangents: Points, j: int) -> float:
    """Way [m] from point j - 1 to j along the smoothed direction: noise does not lengthen it."""
    dx, dy = points[j, 0] - points[j - 1, 0], points[j, 1] - points[j - 1, 1]
    tx, ty = tangents[j, 0] + tangents[j - 1, 0], tangents[j, 1] + tangents[j - 1, 1]
    return float((dx * tx + dy * ty) / (magnitude(tx, ty) + 1e-300))


@inlined
def _is_smooth(run: NDArray[np.int64]) -> bool:
    """Has the run nothing but foot points, or too few points to smooth?"""
    n = run[END] - run[BEGIN]
    return bool(run[KNOWN_END] - run[KNOWN_BEGIN] == n or n < 2)


@lean_part
def _raw_parameters(
    run: NDArray[np.int64],
    curves: NDArray[np.int64],
    u: Vector,
    points: Points,
    tangents: Points,
    knot_step_m: float,
    run_u: Vector,
) -> tuple[int, int]:
    """Foot points where the run is matched, the way along it elsewhere; the lattice they need."""
    begin, end = run[BEGIN], run[END]
    known_begin, known_end = run[KNOWN_BEGIN], run[KNOWN_END]
    run_u[known_begin - begin] = u[known_begin] if known_end > known_begin else 0.0
    for j in range(known_begin + 1, end):
        if j < known_end and curves[j] == run[CURVE]:
            run_u[j - begin] = u[j]
        else:  # beyond the curve, or a miss that the run bridges
            run_u[j - begin] = run_u[j - 1 - begin] + _advance(points, tangents, j) / knot_step_m
    for j in range(known_begin - 1, begin - 1, -1):
        run_u[j - begin] = run_u[j + 1 - begin] - _advance(points, tangents, j + 1) / knot_step_m
    first_u, last_u = least_and_greatest(run_u)
    return lattice_domain(first_u, last_u)


@lean_part
def _smooth_parameters(
    run: NDArray[np.int64],
    points: Points,
    matrix: Points,
    knot_step_m: float,
    first_penalty: float,
    low: int,
    count: int,
    run_u: Vector,
    arc_u: Vector,
    weights: Vector,
    room: FitRoom,
) -> None:
    """Arc length along a smooth fit of `count` rows for the points that are not matched."""
    begin, end = run[BEGIN], run[END]
    known_begin, known_end = run[KNOWN_BEGIN], run[KNOWN_END]
    n, anchor = end - begin, known_begin - begin
    spacing_weights(run_u, 1.0, weights)
    for i in range(count):
        room.is_known[i] = 0.0
    if not solve_fit(run_u, points[begin:end], weights, matrix, low, first_penalty, count, room):
        return
    for j in range(n):
        arc_u[j] = run_u[j]
    first_fit = room.solution[:count]
    arc_length_parameters(arc_u, first_fit, matrix, low, anchor, knot_step_m, room.basis)
    for j in range(anchor):
        run_u[j] = arc_u[j]
    if known_end > begin:
        last = known_end - 1 - begin
        behind = run_u[last] - arc_u[last] if known_end > known_begin else 0.0
        for j in range(last + 1, n):
            run_u[j] = arc_u[j] + behind
    else:
        for j in range(n):
            run_u[j] = arc_u[j]


@kernel
def run_parameters(
    run: NDArray[np.int64],
    curves: NDArray[np.int64],
    u: Vector,
    points: Points,
    tangents: Points,
    matrix: Points,
    knot_step_m: float,
    first_penalty: float,
    run_u: Vector,
) -> None:
    """Parameters of a run: foot points where it is matched, arc length where it is not."""
    low, high = _raw_parameters(run, curves, u, points, tangents, knot_step_m, run_u)
    if _is_smooth(run):
        return
    order, n = matrix.shape[0], len(run_u)
    count = high - low + order - 1
    _smooth_parameters(
        run,
        points,
        matrix,
        knot_step_m,
        first_penalty,
        low,
        count,
        run_u,
        np.empty(n),
        np.empty(n),
        fit_room(count, order),
    )


@part
def merge_runs(
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    runs: NDArray[np.int64],
    resume: int,
    curves: NDArray[np.int64],
    u: Vector,
    points: Points,
    tangents: Points,
    max_weight: float,
    penalty: float,
    first_penalty: float,
    roughest_m: float,
    by_table: bool,
) -> int:
    """Merge the runs from `resume` on; the first one that finds no room, or their number."""
    order, n = matrix.shape[0], len(points)
    all_u, all_arc, all_weights = np.empty(n), np.empty(n), np.empty(n)
    room = fit_room(n + 2 * order, order)
    for r in range(resume, len(runs)):
        run, curve, begin, end = runs[r], runs[r, CURVE], runs[r, BEGIN], runs[r, END]
        known_begin, known_end = run[KNOWN_BEGIN], run[KNOWN_END]
        run_u, arc_u, weights = (
            all_u[: end - begin],
            all_arc[: end - begin],
            all_weights[: end - begin],
        )
        low, high = _raw_parameters(run, curves, u, points, tangents, knot_step_m, run_u)
        if not _is_smooth(run):
            fitted = high - low + order - 1
            if fitted > len(room.share):
                room = fit_room(2 * fitted, order)
            _smooth_parameters(
                run,
                points,
                matrix,
                knot_step_m,
                first_penalty,
                low,
                fitted,
                run_u,
                arc_u,
                weights,
                room,
            )
        least, greatest = least_and_greatest(run_u)
        rows = math.ceil(greatest - least) + 2 * order
        if rows > len(room.share):
            room = fit_room(2 * rows, order)
        if curve >= 0:
            rows += level.count[curve]
        if not has_room(level, 2 * rows + 16):
            level.sizes[3] = 2 * rows + 16
            return r
        spacing_weights(run_u, 1.0, weights)
        for j in range(known_begin, known_end):
            if curves[j] != curve:
                weights[j - begin] = 0.0
        while True:  # all of the run; where that fits badly, what of it is matched
            merged = merge_run(
                level,
                matrix,
                knot_step_m,
                curve,
                run_u[begin - run[BEGIN] : end - run[BEGIN]],
                points[begin:end],
                weights[begin - run[BEGIN] : end - run[BEGIN]],
                max_weight,
                penalty,
                roughest_m,
                by_table,
                room,
            )
            if merged or not known_begin < known_end or known_end - known_begin == end - begin:
                break
            begin, end = known_begin, known_end
    return len(runs)
