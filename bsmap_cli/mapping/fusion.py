"""Two maps of one lattice step into one: the curves of the second enter the first by weight.

Each drawn piece of the second map is a cluster of one long scan: its samples find the curves that
they lie on, and what lies on none extends a curve or starts one (Algorithm 1, line 4). What a
control point of the second map has observed, its weight, enters the running mean as so many
scans would, eq. (13), whatever the order of the maps; no weight is cut off before both are one.
"""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.geometry.compiled import kernel
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.association import match_points
from bsmap_cli.mapping.control_points import fit_control_points
from bsmap_cli.mapping.curve_map import CurveMap, refresh_spans
from bsmap_cli.mapping.fitting import lattice_domain, spacing_weights
from bsmap_cli.mapping.least_surface import LeastSurface
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.map_document import MapLevel
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.merging import extend_rows, merge_fitted, observed_share
from bsmap_cli.mapping.run_merging import run_parameters
from bsmap_cli.mapping.runs import BEGIN, CURVE, END, KNOWN_BEGIN, KNOWN_END, plan_runs
from bsmap_cli.mapping.sampling import sample_level

SAMPLES_PER_STEP = 8
PENALTY = 1e-4  # on third differences: samples of a curve carry no noise


def fuse_level(curve_map: CurveMap, level: MapLevel, settings: MappingSettings) -> None:
    """Let all curves of a level, of the map's knot step, degree and frame, enter the map."""
    samples = sample_level(level, level.knot_step_m / SAMPLES_PER_STEP)
    bounds = np.flatnonzero(np.diff(samples.piece, prepend=-1, append=-2))
    pieces = list(zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True))
    heaviness = [float(samples.weight[begin:end].sum()) for begin, end in pieces]
    for k in np.argsort(-np.array(heaviness), kind="stable"):
        rows = slice(*pieces[k])
        seen = int(level.observations[samples.curve[rows.start]])
        _fuse_piece(
            curve_map,
            samples.points[rows],
            samples.tangents[rows],
            samples.weight[rows],
            seen,
            settings,
        )


def _fuse_piece(
    curve_map: CurveMap,
    points: Points,
    tangents: Points,
    sample_weights: Vector,
    seen: int,
    settings: MappingSettings,
) -> None:
    """Cut one piece into runs, each of one map curve or of none, and fuse these."""
    n, step = len(points), curve_map.knot_step_m
    starts = np.array([0, n])
    curves, u = np.empty(n, np.int64), np.zeros(n)
    match_points(
        curve_map.arrays,
        curve_map.matrix,
        step,
        points,
        tangents,
        starts,
        settings.association.track_dist * step,
        curves,
        u,
    )
    runs = np.empty((2 * n + 2, 5), np.int64)
    least_m = settings.segmentation.min_length * step
    count = plan_runs(
        curve_map.arrays,
        points,
        starts,
        curves,
        u,
        step,
        LeastSurface(2, least_m, 2, least_m),
        runs,
    )
    for run in runs[:count]:
        part = slice(int(run[BEGIN]), int(run[END]))
        run_u, share = np.empty(part.stop - part.start), np.empty(part.stop - part.start)
        run_parameters(
            run,
            curves,
            u,
            points,
            tangents,
            curve_map.matrix,
            step,
            settings.fitting.first_penalty,
            run_u,
        )
        spacing_weights(run_u, 1.0, share)
        known = np.arange(part.start, part.stop)
        missed = (known >= run[KNOWN_BEGIN]) & (known < run[KNOWN_END])
        share[missed & (curves[part] != run[CURVE])] = 0.0
        _fuse_run(
            curve_map, int(run[CURVE]), run_u, points[part], share, sample_weights[part], seen
        )


def _fuse_run(
    curve_map: CurveMap,
    curve: int,
    u: Vector,
    points: Points,
    share: Vector,
    sample_weights: Vector,
    seen: int,
) -> None:
    """Fit a run on the lattice of its curve and average it in; curve : -1 starts one."""
    low, high = lattice_domain(float(u.min()), float(u.max()))
    count = high - low + curve_map.degree
    fitted, none = np.empty((count, 2)), np.zeros((count, 2))
    if not fit_control_points(
        u, points, share, curve_map.matrix, low, PENALTY, none, np.zeros(count), fitted
    ):
        return
    covered, weighted = np.empty(count), np.empty(count)
    observed_share(u, share, curve_map.matrix, low, covered)
    observed_share(u, share * sample_weights, curve_map.matrix, low, weighted)
    weights = np.minimum(covered, 1.0) * weighted / np.maximum(covered, 1e-9)
    held = int(curve_map.arrays.count[curve]) if curve >= 0 else 0
    gap = abs(low - int(curve_map.arrays.first[curve])) if curve >= 0 else 0
    curve_map.reserve(2 * (count + held + gap) + 64)
    arrays, first = curve_map.arrays, low - curve_map.degree
    if curve < 0:
        curve = int(
            merge_fitted(
                arrays,
                curve_map.matrix,
                curve_map.knot_step_m,
                -1,
                first,
                fitted,
                np.minimum(covered, 1.0),
                float(u.min()),
                float(u.max()),
                math.inf,
                False,
            )
        )
        begin = int(arrays.offset[curve])
        arrays.weights[begin : begin + count] = np.maximum(weights, arrays.weights[begin])
        arrays.seen[curve] = seen
        refresh_spans(arrays, curve_map.matrix, curve_map.knot_step_m, curve, begin, begin + count)
        return
    average_in(
        arrays,
        curve_map.matrix,
        curve_map.knot_step_m,
        curve,
        first,
        fitted,
        weights,
        float(u.min()),
        float(u.max()),
    )
    arrays.seen[curve] = min(65535, int(arrays.seen[curve]) + seen)


@kernel
def average_in(
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    curve: int,
    first: int,
    fitted: Points,
    weights: Vector,
    start_u: float,
    end_u: float,
) -> None:
    """The weighted mean of a curve's control points and others, from lattice index `first` on.

    Data support of the others [start_u, end_u]; there must be room for them.
    """
    count = len(fitted)
    extend_rows(level, curve, first, first + count)
    offset = level.offset[curve] + first - level.first[curve]
    for i in range(count):
        row = offset + i
        old, new = level.weights[row], weights[i]
        total = old + new
        if total <= 0.0:
            level.points[row, 0], level.points[row, 1] = fitted[i, 0], fitted[i, 1]
            continue
        for axis in range(2):
            gain = new / total if old > 0.0 else 1.0
            level.points[row, axis] += gain * (fitted[i, axis] - level.points[row, axis])
        level.weights[row] = total
    level.support[curve, 0] = min(level.support[curve, 0], start_u)
    level.support[curve, 1] = max(level.support[curve, 1], end_u)
    begin = level.offset[curve]
    refresh_spans(level, matrix, knot_step_m, curve, begin, begin + level.count[curve])
