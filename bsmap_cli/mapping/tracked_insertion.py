"""Insert clusters that are tracked from scan to scan: Algorithm 1, lines 3.1 to 4.2.1, as printed.

A cluster belongs to the map curve that its predecessor in the last scan went into. Its points lie
on that curve's lattice once the offset tau_1 is found.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.curve import Curve
from bsmap_cli.geometry.se2 import Points
from bsmap_cli.mapping.alignment import align_offset
from bsmap_cli.mapping.centroid_tracking import Tracks, cluster_centroids, track_clusters
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.curve_merge import merge_curve
from bsmap_cli.mapping.fitting import fit_curve
from bsmap_cli.mapping.mapping_settings import MappingSettings


def insert_tracked(
    curve_map: CurveMap,
    points: Points,
    starts: NDArray[np.int64],
    settings: MappingSettings,
) -> None:
    """Let the clusters of one scan, already in the map frame (2), change the map."""
    last = curve_map.tracks
    centroids = cluster_centroids(points, starts)  # eq. (4)
    reach_m = settings.association.track_dist * curve_map.knot_step_m
    tracked = track_clusters(centroids, last, reach_m)  # eq. (5)
    curves, starts_m = np.full(len(centroids), -1), np.zeros(len(centroids))
    for c, (begin, end) in enumerate(pairwise(starts)):
        cluster = points[begin:end]
        if len(cluster) <= curve_map.degree:
            continue  # too few for any curve
        scan_curve = None
        if last is not None and tracked[c] >= 0:
            index = int(last.curves[tracked[c]])
            start_m = float(last.starts_m[tracked[c]])
            scan_curve = _fit_on(curve_map, index, cluster, start_m, settings)
        if scan_curve is not None:
            curves[c] = merge_curve(curve_map, index, scan_curve, settings.merging)  # eq. (13)
        else:
            scan_curve = _fit(curve_map, cluster, 0.0, settings)  # tau_1 = 0
            curves[c] = merge_curve(curve_map, -1, scan_curve, settings.merging)  # eq. (12)
        starts_m[c] = scan_curve.tau_start_m
    kept = curves >= 0
    curve_map.tracks = Tracks(centroids[kept], curves[kept], starts_m[kept])


def _fit_on(
    curve_map: CurveMap, index: int, cluster: Points, start_m: float, settings: MappingSettings
) -> Curve | None:
    """The cluster's curve on the lattice of a map curve; None where the two do not overlap."""
    scan_curve = _fit(curve_map, cluster, start_m, settings)  # eqs. (6)-(8)
    shift_m = align_offset(curve_map.curve(index), scan_curve, settings.alignment)  # eqs. (9)-(11)
    return None if shift_m is None else _fit(curve_map, cluster, start_m + shift_m, settings)


def _fit(curve_map: CurveMap, cluster: Points, start_m: float, settings: MappingSettings) -> Curve:
    return fit_curve(
        cluster,
        settings.fitting,
        knot_step_m=curve_map.knot_step_m,
        degree=curve_map.degree,
        start_m=start_m,
    )
