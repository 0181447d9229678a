"""Surfaces as a scan would show them, for the tests of mapping and SLAM."""

import numpy as np

from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.insertion import insert_clusters
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.segmentation import Clusters

STEP = 0.1
MATRIX = basis_matrix(3)
SETTINGS = MappingSettings(ladder=(STEP,))
STILL = np.zeros(3)


def line(start, end, spacing=0.02):
    """Points from start to end, `spacing` apart."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    count = max(2, round(np.hypot(*(end - start)) / spacing) + 1)
    return start + np.linspace(0.0, 1.0, count)[:, None] * (end - start)


def arc(centre, radius, begin, end, spacing=0.02):
    """Points on a circle, from one angle to another."""
    count = max(2, round(abs(end - begin) * radius / spacing) + 1)
    angle = np.linspace(begin, end, count)
    return np.asarray(centre) + radius * np.column_stack((np.cos(angle), np.sin(angle)))


def as_clusters(*parts, knot_step_m=STEP, sigma_m=0.0):
    """Each part becomes one cluster, unthinned."""
    points = np.concatenate([np.zeros((0, 2)), *parts])
    starts = np.concatenate(([0], np.cumsum([len(part) for part in parts]))).astype(np.int64)
    return Clusters.with_tangents(points, np.ones(len(points)), starts, knot_step_m, sigma_m)


def insert(curve_map, *parts, sigma_m=0.0, settings=SETTINGS, pose=STILL):
    """Let the map see the parts once."""
    step = curve_map.knot_step_m
    seen = as_clusters(*parts, knot_step_m=step, sigma_m=sigma_m)
    insert_clusters(curve_map, seen, np.asarray(pose, float), settings)


def new_map(step=STEP, rows=256):
    """An empty cubic map."""
    return CurveMap(step, 3, rows=rows)


def frozen(curve_map):
    """The curves of a map as `Curve` objects."""
    from bsmap_cli.mapping.freeze import freeze_level

    return list(freeze_level(curve_map, max_weight=255))


def live_curves(curve_map):
    """(lattice index I, control points, weights, support) of each curve, copied from the arrays."""
    arrays = curve_map.arrays
    found = []
    for curve in range(len(curve_map)):
        begin, count = arrays.offset[curve], arrays.count[curve]
        rows = slice(begin, begin + count)
        found.append(
            (
                int(arrays.first[curve]),
                arrays.points[rows].copy(),
                arrays.weights[rows].copy(),
                arrays.support[curve].copy(),
            )
        )
    return found


def drawn_points(curve, count=400):
    """Points along the part of a curve that data support."""
    return curve.evaluate(np.linspace(curve.tau_start_m, curve.tau_end_m, count))


def speeds(curve, count=400):
    """|ds/dtau| along the part of a curve that data support."""
    tau = np.linspace(curve.tau_start_m, curve.tau_end_m, count)
    return np.hypot(*curve.evaluate(tau, 1).T)
