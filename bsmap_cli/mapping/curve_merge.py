"""Let a fitted curve of a scan change the map: eqs. (12)(13), by Table I or by observed share."""

from __future__ import annotations

import numpy as np

from bsmap_cli.geometry.curve import Curve
from bsmap_cli.geometry.se2 import Vector
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.merging import MergingSettings, has_room, merge_fitted, observed_share

SAMPLES_PER_SPAN = 16


def merge_curve(
    curve_map: CurveMap, index: int, scan_curve: Curve, settings: MergingSettings
) -> int:
    """Merge a curve on the lattice of map curve `index`, or start one with it (-1); its index."""
    step = curve_map.knot_step_m
    count = len(scan_curve.control_points)
    held = int(curve_map.arrays.count[index]) if index >= 0 else 0
    gap = max(0, abs(scan_curve.first_index - int(curve_map.arrays.first[index]))) if held else 0
    rows = 2 * (count + held + gap) + 16
    if not has_room(curve_map.arrays, rows):
        curve_map.reserve(rows)
    return int(
        merge_fitted(
            curve_map.arrays,
            curve_map.matrix,
            step,
            index,
            scan_curve.first_index,
            scan_curve.control_points,
            covered_share(scan_curve, curve_map.matrix),
            scan_curve.tau_start_m / step,
            scan_curve.tau_end_m / step,
            float(settings.max_weight),
            settings.method == "table",
        )
    )


def covered_share(curve: Curve, matrix: Vector) -> Vector:
    """(N,) share of each basis function over which the curve has data, 1 inside."""
    start, end = curve.tau_start_m / curve.knot_step_m, curve.tau_end_m / curve.knot_step_m
    samples = max(1, round((end - start) * SAMPLES_PER_SPAN))
    u = start + (end - start) * (np.arange(samples) + 0.5) / samples
    omega = np.empty(len(curve.control_points))
    weights = np.full(samples, (end - start) / samples)
    observed_share(u, weights, matrix, curve.first_index + curve.degree, omega)
    return omega
