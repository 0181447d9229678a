"""Insert the clusters of one scan into one level of the map: Algorithm 1, lines 3.1 to 4.2.1."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import kernel
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.association import match_points
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.least_surface import LeastSurface
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.run_merging import merge_runs
from bsmap_cli.mapping.runs import plan_runs
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.mapping.tracked_insertion import insert_tracked


def rotate(pose: Vector, vectors: Points) -> Points:
    """(n, 2) directions of the inner frame, in the outer one."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(vectors @ np.array([[cos, sin], [-sin, cos]]))


@kernel
def _place_and_plan(
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    points_body: Points,
    tangents_body: Points,
    starts: NDArray[np.int64],
    pose: Vector,
    gate_m: float,
    least: LeastSurface,
    points: Points,
    tangents: Points,
    curves: NDArray[np.int64],
    u: Vector,
    runs: NDArray[np.int64],
) -> int:
    """Place the scan, eq. (2), match its points and cut it into runs; their number."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for j in range(len(points)):
        points[j, 0] = cos * points_body[j, 0] - sin * points_body[j, 1] + pose[0]
        points[j, 1] = sin * points_body[j, 0] + cos * points_body[j, 1] + pose[1]
        tangents[j, 0] = cos * tangents_body[j, 0] - sin * tangents_body[j, 1]
        tangents[j, 1] = sin * tangents_body[j, 0] + cos * tangents_body[j, 1]
    polynomial = np.empty((matrix.shape[0], 2))
    match_points(
        level, matrix, knot_step_m, points, tangents, starts, gate_m, curves, u, polynomial
    )
    return plan_runs(level, points, starts, curves, u, knot_step_m, least, runs)


def insert_clusters(
    curve_map: CurveMap,
    clusters: Clusters,
    pose_map_body: Vector,
    settings: MappingSettings,
) -> None:
    """Match, fit and merge; frame of the map = frame of the pose."""
    if settings.association.method == "centroid":
        points = rotate(pose_map_body, clusters.points) + pose_map_body[:2]  # eq. (2)
        insert_tracked(curve_map, points, clusters.starts, settings)
        return
    n = len(clusters.points)
    if n == 0:
        return
    step = curve_map.knot_step_m
    points, tangents = np.empty((n, 2)), np.empty((n, 2))
    curves, u = np.empty(n, np.int64), np.zeros(n)
    runs = np.empty((2 * n + 2, 5), np.int64)
    count = _place_and_plan(
        curve_map.arrays,
        curve_map.matrix,
        step,
        clusters.points,
        clusters.tangents,
        clusters.starts,
        pose_map_body,
        settings.association.track_dist * step,
        settings.segmentation.least(step),
        points,
        tangents,
        curves,
        u,
        runs,
    )
    done = 0
    while done < count:
        done = merge_runs(
            curve_map.arrays,
            curve_map.matrix,
            step,
            runs[:count],
            done,
            curves,
            u,
            points,
            tangents,
            float(settings.merging.max_weight),
            settings.fitting.penalty,
            settings.fitting.first_penalty,
            settings.merging.roughest * step,
            settings.merging.method == "table",
        )
        if done < count:
            curve_map.reserve(int(curve_map.arrays.sizes[3]))
