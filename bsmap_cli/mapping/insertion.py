"""Insert the clusters of one scan into one level of the map: Algorithm 1, lines 3.1 to 4.2.1."""

from __future__ import annotations

import numpy as np

from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.association import match_points
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.run_merging import merge_runs
from bsmap_cli.mapping.runs import plan_runs
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.mapping.tracked_insertion import insert_tracked


def rotate(pose: Vector, vectors: Points) -> Points:
    """(n, 2) directions of the inner frame, in the outer one."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(vectors @ np.array([[cos, sin], [-sin, cos]]))


def insert_clusters(
    curve_map: CurveMap,
    clusters: Clusters,
    pose_map_body: Vector,
    settings: MappingSettings,
) -> None:
    """Match, fit and merge; frame of the map = frame of the pose."""
    points = rotate(pose_map_body, clusters.points) + pose_map_body[:2]  # eq. (2)
    if settings.association.method == "centroid":
        insert_tracked(curve_map, points, clusters.starts, settings)
        return
    n = len(points)
    if n == 0:
        return
    step = curve_map.knot_step_m
    tangents = rotate(pose_map_body, clusters.tangents)
    curves, u = np.empty(n, np.int64), np.zeros(n)
    match_points(
        curve_map.arrays,
        curve_map.matrix,
        step,
        points,
        tangents,
        clusters.starts,
        settings.association.track_dist * step,
        curves,
        u,
    )
    runs = np.empty((2 * n + 2, 5), np.int64)
    count = plan_runs(
        curve_map.arrays,
        points,
        clusters.starts,
        curves,
        u,
        step,
        settings.segmentation.min_length * step,
        settings.segmentation.min_points,
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
