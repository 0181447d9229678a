"""Extend and average map curves: Sec. III-D, eqs. (12)(13) and Table I.

Two curves on one lattice share their basis functions, so a weighted sum of curves is the same
weighted sum of control points, exactly. Table I is that union written out. Here each control
point of a scan also carries the share omega in [0, 1] of its basis function that data cover,
and enters the average with it: one rule for interior and ends.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bsmap_cli.geometry.compiled import inlined, kernel, lean, lean_part
from bsmap_cli.geometry.kernels import basis_weights
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.control_points import FitRoom, fit_rms, solve_fit
from bsmap_cli.mapping.curve_map import refresh_spans
from bsmap_cli.mapping.fitting import lattice_domain, least_and_greatest
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.span_index import remove_span
from bsmap_cli.mapping.table_merge import merge_by_table
from bsmap_cli.settings import setting

KNOWN_WEIGHT = 0.25  # of a control point whose place says where the curve runs
LEAST_WEIGHT = 1e-3  # of a control point that only the tip of its basis function has seen


@dataclass(frozen=True, slots=True, kw_only=True)
class MergingSettings:
    """How new curves enter the map."""

    method: str = setting(
        "fractional",
        "weigh control points by the data under their basis function, or Table I as printed",
        choices=("fractional", "table"),
    )
    max_weight: int = setting(
        50,
        "a control point counts at most so many observations",
        symbol="gamma_weight",
        minimum=1,
        maximum=255,
    )
    roughest: float = setting(
        0.25,
        "points that miss their own curve by more, root mean square, are none [knot steps]",
        minimum=0.0,
    )


@inlined
def has_room(level: LevelArrays, rows: int) -> bool:
    """Can a curve grow or start that needs `rows` rows?"""
    return bool(
        level.sizes[1] + rows <= len(level.weights)
        and level.sizes[0] + 1 < len(level.first)
        and 2 * (level.sizes[2] + rows) <= len(level.cell_keys)
    )


@lean_part
def _claim_rows(level: LevelArrays, curve: int, first: int, count: int) -> int:
    """Give a curve fresh rows with room at both ends; returns its new offset."""
    slack = max(4, count // 2)
    low = level.sizes[1]
    level.low[curve] = low
    level.high[curve] = low + count + 2 * slack
    level.sizes[1] = level.high[curve]
    level.first[curve] = first
    level.count[curve] = count
    level.offset[curve] = low + slack
    for row in range(low, level.high[curve]):
        level.owner[row] = curve
        level.span_cell[row] = -1
    return int(low + slack)


@lean
def extend_rows(level: LevelArrays, curve: int, first: int, end: int) -> bool:
    """Let a curve hold the lattice indices `first` .. `end` - 1 too; True if its rows moved.

    New control points have weight 0.
    """
    old_first, old_count, old_offset = level.first[curve], level.count[curve], level.offset[curve]
    new_first = min(first, old_first)
    new_count = max(end, old_first + old_count) - new_first
    offset = old_offset - (old_first - new_first)
    moved = offset < level.low[curve] or offset + new_count > level.high[curve]
    if moved:
        for row in range(old_offset, old_offset + old_count):
            remove_span(level, row)
            level.owner[row] = -1
        offset = _claim_rows(level, curve, new_first, new_count)
        shift = offset + (old_first - new_first) - old_offset
        for row in range(old_offset, old_offset + old_count):
            level.points[row + shift, 0] = level.points[row, 0]
            level.points[row + shift, 1] = level.points[row, 1]
            level.weights[row + shift] = level.weights[row]
    level.first[curve] = new_first
    level.count[curve] = new_count
    level.offset[curve] = offset
    for row in range(offset, offset + old_first - new_first):
        level.weights[row] = 0.0
    for row in range(offset + old_first - new_first + old_count, offset + new_count):
        level.weights[row] = 0.0
    return bool(moved)


@lean_part
def _start_curve(level: LevelArrays, first: int, count: int) -> int:
    """A new curve without observations, eq. (12)."""
    curve = level.sizes[0]
    level.sizes[0] += 1
    offset = _claim_rows(level, curve, first, count)
    for row in range(offset, offset + count):
        level.weights[row] = 0.0
    level.support[curve, 0] = math.inf
    level.support[curve, 1] = -math.inf
    level.seen[curve] = 0
    return int(curve)


@kernel
def observed_share(u: Vector, weights: Vector, matrix: Points, low: int, omega: Vector) -> None:
    """omega_g = sum_j (ds_j / Delta) B_g(tau_j): 1 inside the data whatever their density."""
    order = matrix.shape[0]
    basis = np.empty(order)
    for i in range(len(omega)):
        omega[i] = 0.0
    for j in range(len(u)):
        span = min(max(math.floor(u[j]) - low, 0), len(omega) - order)
        basis_weights(matrix, u[j] - low - span, basis)
        for a in range(order):
            omega[span + a] += weights[j] * basis[a]


@lean
def merge_fitted(
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    curve: int,
    first: int,
    fitted: Points,
    omega: Vector,
    start_u: float,
    end_u: float,
    max_weight: float,
    by_table: bool,
) -> int:
    """Average control points, the first at lattice index `first`, into a curve; its index.

    curve : -1 starts a new one. Data support [start_u, end_u]. by_table : by Table I, otherwise
    each with its share `omega`.
    """
    count = len(fitted)
    moved = False
    map_first = map_end = first
    if curve < 0:
        curve = _start_curve(level, first, count)
    else:
        map_first, map_end = level.first[curve], level.first[curve] + level.count[curve]
        moved = extend_rows(level, curve, first, first + count)
    offset = level.offset[curve] + first - level.first[curve]
    if by_table:
        degree = matrix.shape[0] - 1
        merge_by_table(level, curve, map_first, map_end, first, fitted, degree, max_weight)
    for i in range(0 if by_table else count):
        row = offset + i
        share = min(1.0, omega[i])
        old = level.weights[row]
        if old <= 0.0:
            level.points[row, 0], level.points[row, 1] = fitted[i, 0], fitted[i, 1]
            level.weights[row] = max(share, LEAST_WEIGHT)
        else:
            new = min(max_weight, old + share)
            gain = share / max(new, LEAST_WEIGHT)  # the running mean, then a fading one
            level.points[row, 0] += gain * (fitted[i, 0] - level.points[row, 0])
            level.points[row, 1] += gain * (fitted[i, 1] - level.points[row, 1])
            level.weights[row] = new
    level.support[curve, 0] = min(level.support[curve, 0], start_u)
    level.support[curve, 1] = max(level.support[curve, 1], end_u)
    level.seen[curve] += 1
    if moved:
        offset, count = level.offset[curve], level.count[curve]
    refresh_spans(level, matrix, knot_step_m, curve, offset, offset + count)
    return curve


@lean_part
def merge_run(
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    curve: int,
    u: Vector,
    points: Points,
    weights: Vector,
    max_weight: float,
    penalty: float,
    roughest_m: float,
    by_table: bool,
    room: FitRoom,
) -> bool:
    """Fit points with known parameters on the lattice of a curve and average the fit into it.

    curve : -1 starts a new one. by_table : by Table I, after a fit that knows nothing of the map.
    False, and nothing changed, where the fit misses the points by
    more than `roughest_m`: foliage and clutter are no curves.
    """
    degree = matrix.shape[0] - 1
    start_u, end_u = least_and_greatest(u)
    low, high = lattice_domain(start_u, end_u)
    first, count = low - degree, high - low + degree
    for i in range(count):
        room.is_known[i] = 0.0
    if curve >= 0 and not by_table:
        shift = level.offset[curve] + first - level.first[curve]
        for i in range(count):
            row = shift + i
            inside = level.offset[curve] <= row < level.offset[curve] + level.count[curve]
            if inside and level.weights[row] >= KNOWN_WEIGHT:
                room.known[i, 0], room.known[i, 1] = level.points[row, 0], level.points[row, 1]
                room.is_known[i] = 1.0
    if not solve_fit(u, points, weights, matrix, low, penalty, count, room):
        return False
    if fit_rms(u, points, weights, matrix, low, count, room) > roughest_m:
        return False
    merge_fitted(
        level,
        matrix,
        knot_step_m,
        curve,
        first,
        room.solution[:count],
        room.share[:count],
        start_u,
        end_u,
        max_weight,
        by_table,
    )
    return True
