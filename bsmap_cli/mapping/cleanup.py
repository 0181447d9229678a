"""Tidy a level once it stands: absorb what is drawn twice, join ends that meet.

A wall seen first in pieces leaves curves that overlap or follow one another. The lighter gives
way where the heavier covers it; where one then begins at the other's end, it is sampled and fitted
on the other's lattice: their offsets differ by no whole knots.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, kernel, lean
from bsmap_cli.geometry.foot_points import span_jet
from bsmap_cli.geometry.kernels import magnitude
from bsmap_cli.geometry.near_pairs import sort_into_cells
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.control_points import fit_control_points
from bsmap_cli.mapping.curve_map import CurveMap, refresh_spans
from bsmap_cli.mapping.fitting import lattice_domain, spacing_weights
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.merging import extend_rows
from bsmap_cli.mapping.span_index import EMPTY, cell_key, find_slot, remove_span

SAMPLES = 4  # a knot step
COVER_STEPS, COVER_COSINE = 0.5, 0.866  # runs together: within half a knot step and 30 degrees
ABSORBED = 0.8  # covered share at which a curve goes altogether
JOIN_STEPS, JOIN_ASIDE, JOIN_COSINE = 1.0, 0.25, 0.94  # gap along, aside [knot steps]; 20 degrees
JOIN_SAMPLES, JOIN_TAIL, JOIN_PENALTY = 8, 8.0, 1e-6  # a knot step; knot steps before the seam


@lean
def sample_curve(
    level: LevelArrays, matrix: Points, curve: int, u: Vector, points: Points, tangents: Points
) -> None:
    """Points and unit tangents of a curve at the parameters u [lattice units]."""
    degree = matrix.shape[0] - 1
    base = level.first[curve] + degree
    for j in range(len(u)):
        span = min(max(math.floor(u[j]) - base, 0), level.count[curve] - degree - 1)
        jet = span_jet(level.points, level.offset[curve] + span, matrix, u[j] - base - span)
        norm = magnitude(jet.dx, jet.dy) + 1e-300
        points[j, 0], points[j, 1] = jet.x, jet.y
        tangents[j, 0], tangents[j, 1] = jet.dx / norm, jet.dy / norm


@lean
def _weigh_curves(level: LevelArrays, heaviness: Vector) -> None:
    """Mean weight of each curve times its length [lattice units]."""
    for c in range(len(heaviness)):
        total = 0.0
        for row in range(level.offset[c], level.offset[c] + level.count[c]):
            total += level.weights[row]
        length = level.support[c, 1] - level.support[c, 0]
        heaviness[c] = total / level.count[c] * length if level.count[c] > 0 else 0.0


@inlined
def _is_covered(
    level: LevelArrays,
    knot_step_m: float,
    heaviness: Vector,
    curve: int,
    u: float,
    px: float,
    py: float,
    tx: float,
    ty: float,
    degree: int,
) -> bool:
    """Does a heavier curve, or a much earlier part of this one, pass here in this direction?"""
    column, line = math.floor(px / knot_step_m), math.floor(py / knot_step_m)
    reach2 = (COVER_STEPS * knot_step_m) ** 2
    for i in range(column - 1, column + 2):
        for j in range(line - 1, line + 2):
            slot = find_slot(level, cell_key(i, j))
            if level.cell_keys[slot] == EMPTY:
                continue
            row = level.cell_heads[slot]
            while row >= 0:
                other = level.owner[row]
                span_u = float(level.first[other] + degree + row - level.offset[other])
                earlier = other == curve and span_u + 3.0 < u
                if earlier or (other != curve and heaviness[other] > heaviness[curve]):
                    hx, hy = level.spans[row, 2], level.spans[row, 3]
                    half2 = hx * hx + hy * hy + 1e-300
                    dx, dy = px - level.spans[row, 0], py - level.spans[row, 1]
                    s = min(1.0, max(-1.0, (dx * hx + dy * hy) / half2))
                    ex, ey = dx - s * hx, dy - s * hy
                    along = (hx * tx + hy * ty) / math.sqrt(half2)
                    if along > COVER_COSINE and ex * ex + ey * ey < reach2:
                        return True
                row = level.next_span[row]
    return False


@lean
def cut_curve(
    level: LevelArrays, matrix: Points, knot_step_m: float, curve: int, start: float, end: float
) -> None:
    """Keep of a curve only what lies in [start, end]; nothing of it where that is empty."""
    offset, count = level.offset[curve], level.count[curve]
    if end <= start:
        for row in range(offset, offset + count):
            remove_span(level, row)
        level.count[curve] = 0
        return
    level.support[curve, 0] = start
    level.support[curve, 1] = end
    refresh_spans(level, matrix, knot_step_m, curve, offset, offset + count)


@kernel
def _absorb(
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    heaviness: Vector,
    order: NDArray[np.int64],
    least: float,
) -> None:
    """Cut from each curve, the lightest first, the ends that heavier ones cover."""
    degree = matrix.shape[0] - 1
    for i in range(len(order)):
        curve = order[i]
        if level.count[curve] == 0:
            continue
        start, end = level.support[curve, 0], level.support[curve, 1]
        n = max(2, math.ceil((end - start) * SAMPLES) + 1)
        u, points, tangents = np.empty(n), np.empty((n, 2)), np.empty((n, 2))
        step = (end - start) / (n - 1)
        for j in range(n):
            u[j] = start + j * step if j < n - 1 else end
        sample_curve(level, matrix, curve, u, points, tangents)
        covered = np.empty(n, np.bool_)
        hidden = 0
        for j in range(n):
            covered[j] = _is_covered(
                level,
                knot_step_m,
                heaviness,
                curve,
                u[j],
                points[j, 0],
                points[j, 1],
                tangents[j, 0],
                tangents[j, 1],
                degree,
            )
            hidden += covered[j]
        if hidden / n > ABSORBED:
            cut_curve(level, matrix, knot_step_m, curve, start, start)
            continue
        first, last = 0, n - 1
        while first < n and covered[first]:
            first += 1
        while last > first and covered[last]:
            last -= 1
        if first == 0 and last == n - 1:
            continue
        if u[last] - u[first] < least:
            cut_curve(level, matrix, knot_step_m, curve, start, start)
        else:
            cut_curve(level, matrix, knot_step_m, curve, u[first], u[last])


def _ends(curve_map: CurveMap) -> tuple[NDArray[np.int64], Points, Points]:
    """Live curves, (k, 2, 2) their end points and (k, 2, 2) the tangents there."""
    arrays = curve_map.arrays
    live = np.flatnonzero(arrays.count[: len(curve_map)] > 0)
    points, tangents = np.empty((len(live), 2, 2)), np.empty((len(live), 2, 2))
    for k, curve in enumerate(live.tolist()):
        u = arrays.support[curve].copy()
        sample_curve(arrays, curve_map.matrix, curve, u, points[k], tangents[k])
    return live, points, tangents


def _samples(curve_map: CurveMap, curve: int, start: float, end: float) -> tuple[Vector, Points]:
    """Parameters from `start` to `end` [lattice units] and the points of a curve there."""
    u = np.linspace(start, end, max(8, math.ceil(JOIN_SAMPLES * (end - start))))
    points, tangents = np.empty((len(u), 2)), np.empty((len(u), 2))
    sample_curve(curve_map.arrays, curve_map.matrix, curve, u, points, tangents)
    return u, points


def _join(curve_map: CurveMap, first: int, second: int, along_m: float) -> None:
    """Let curve `second` go on at the end of `first`, which it meets after `along_m`.

    The end of `first` and all of `second` are sampled and fitted together. The control points that
    `first` has beyond its end take no part: they may belong to what was cut off.
    """
    curve_map.reserve(2 * int(curve_map.arrays.count[first] + curve_map.arrays.count[second]) + 64)
    arrays, matrix, degree = curve_map.arrays, curve_map.matrix, curve_map.degree
    (start, end), (own_start, own_end) = arrays.support[[first, second]].tolist()
    tail_u, tail = _samples(curve_map, first, max(start, end - JOIN_TAIL), end)
    own_u, own = _samples(curve_map, second, own_start, own_end)
    start_u = end + along_m / curve_map.knot_step_m
    later_u = own_u - own_start + start_u
    keep = later_u > end + 0.05
    if keep.sum() < 2:
        return
    u, points = np.append(tail_u, later_u[keep]), np.concatenate((tail, own[keep]))
    low, high = lattice_domain(u[0], u[-1])
    count = high - low + degree
    fitted, none, shares = np.empty((count, 2)), np.zeros((count, 2)), np.empty(len(u))
    spacing_weights(u, 1.0, shares)
    if not fit_control_points(
        u, points, shares, matrix, low, JOIN_PENALTY, none, np.zeros(count), fitted
    ):
        return
    indices = np.arange(low - degree, high)
    weights = _joined_weights(curve_map, first, second, indices, start_u)
    # where `first` goes on before the samples, what they see in part alone stays as it is
    new = indices >= (tail_u[0] if tail_u[0] > start else -math.inf)
    extend_rows(arrays, first, int(indices[0]), high)
    rows = int(arrays.offset[first] - arrays.first[first]) + indices[new]
    arrays.points[rows], arrays.weights[rows] = fitted[new], weights[new]
    arrays.seen[first] = max(arrays.seen[first], arrays.seen[second])
    cut_curve(arrays, matrix, curve_map.knot_step_m, first, start, float(u[-1]))
    cut_curve(arrays, matrix, curve_map.knot_step_m, second, 0.0, 0.0)


def _joined_weights(
    curve_map: CurveMap, first: int, second: int, indices: NDArray[np.int64], start_u: float
) -> Vector:
    """Weight of each control point of the joined curve, on which `second` begins at `start_u`."""
    arrays = curve_map.arrays

    def weights_of(curve: int, lattice_indices: Vector) -> Vector:
        rows = np.round(lattice_indices).astype(int) - arrays.first[curve]
        found: Vector = arrays.weights[
            arrays.offset[curve] + np.clip(rows, 0, arrays.count[curve] - 1)
        ]
        return found

    half = 0.5 * (curve_map.degree + 1)
    end_u = arrays.support[first, 1]
    before = weights_of(first, indices.astype(float))
    behind = weights_of(second, indices - start_u + arrays.support[second, 0])
    apart = indices + half - end_u  # from the middle of the support to the seam
    both = np.maximum(before, behind)
    return np.where(apart > half, behind, np.where(apart < -half, before, both))


def _followers(curve_map: CurveMap) -> list[tuple[float, int, int, float]]:
    """Pairs of curves whose end and start meet: cost, first, second, gap along [m]; best first."""
    live, points, tangents = _ends(curve_map)
    step = curve_map.knot_step_m
    if len(live) < 2:
        return []
    reach = step * math.hypot(JOIN_STEPS, JOIN_ASIDE)
    starts, ends, onward = points[:, 0], points[:, 1], tangents[:, 1]
    i, j = sort_into_cells(starts, reach, ends).pairs(ends)
    gap = starts[j] - ends[i]
    along = np.einsum("nk,nk->n", gap, onward[i])
    aside = np.abs(gap[:, 0] * onward[i, 1] - gap[:, 1] * onward[i, 0])
    follows = (
        (i != j)
        & (np.hypot(gap[:, 0], gap[:, 1]) <= reach)
        & (aside < JOIN_ASIDE * step)
        & (np.einsum("nk,nk->n", tangents[j, 0], onward[i]) > JOIN_COSINE)
    )
    cost = np.abs(along) + 4.0 * aside
    columns = (cost, live[i], live[j], along)
    return sorted(zip(*(column[follows].tolist() for column in columns), strict=True))


def _join_ends(curve_map: CurveMap) -> int:
    """Join each end to the start that continues it best; how many were joined."""
    used: set[int] = set()
    for _, first, second, along in _followers(curve_map):
        if first not in used and second not in used:
            used.update((first, second))
            _join(curve_map, first, second, along)
    return len(used) // 2


def tidy(curve_map: CurveMap, *, min_length: float) -> None:
    """Absorb duplicates and join what follows on, until nothing joins any more."""
    for _ in range(6):
        heaviness = np.empty(len(curve_map))
        _weigh_curves(curve_map.arrays, heaviness)
        order = np.argsort(heaviness, kind="stable")
        arrays, matrix, step_m = curve_map.arrays, curve_map.matrix, curve_map.knot_step_m
        _absorb(arrays, matrix, step_m, heaviness, order, min_length)
        if not _join_ends(curve_map):
            break


def drop_unconfirmed(curve_map: CurveMap, min_views: int) -> None:
    """Take out the curves that fewer than `min_views` scans have met: what passes is no map."""
    arrays = curve_map.arrays
    for curve in range(len(curve_map)):
        if arrays.count[curve] > 0 and arrays.seen[curve] < min_views:
            cut_curve(arrays, curve_map.matrix, curve_map.knot_step_m, curve, 0.0, 0.0)
