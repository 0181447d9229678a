"""Track clusters from one scan to the next by their centroids: Sec. III-B, eqs. (4)(5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector


@dataclass(frozen=True, slots=True)
class Tracks:
    """The clusters of the last scan: where they were, and which map curve they became.

    centroids : (c, 2) [m], map frame; curves : (c,) map curve; starts_m : (c,) tau_1 [m] of each
    cluster on its map curve, from which the next scan starts.
    """

    centroids: Points
    curves: NDArray[np.int64]
    starts_m: Vector


def cluster_centroids(points: Points, starts: NDArray[np.int64]) -> Points:
    """(c, 2) mean point of each cluster, eq. (4); starts : (c + 1,) as in `Clusters`."""
    sums = np.add.reduceat(points, starts[:-1], axis=0) if len(starts) > 1 else np.zeros((0, 2))
    means: Points = sums / np.diff(starts)[:, None]
    return means


def track_clusters(centroids: Points, last: Tracks | None, reach_m: float) -> NDArray[np.int64]:
    """(c,) row of `last` nearest to each centroid, -1 where none is within `reach_m`, eq. (5).

    The minimum runs over the clusters j of the last scan (the paper prints i).
    """
    tracked = np.full(len(centroids), -1)
    if last is None or not len(last.curves) or not len(centroids):
        return tracked
    apart = np.hypot(*(centroids[:, None] - last.centroids[None]).transpose(2, 0, 1))
    nearest = apart.argmin(axis=1)
    found = apart[np.arange(len(centroids)), nearest] <= reach_m
    tracked[found] = nearest[found]
    return tracked
