"""The clusters of a scan as they are kept for long: every keyframe has them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import lean
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.segmentation import Clusters

MOST_RETURNS = 65535  # that a count can tell


@dataclass(frozen=True, slots=True)
class CompactClusters:
    """`Clusters` of the finest level in float32 and without tangents."""

    points: NDArray[np.float32]
    counts: NDArray[np.uint16]
    starts: NDArray[np.int32]

    @classmethod
    def pack(cls, clusters: Clusters) -> CompactClusters:
        """Keep what is needed to insert or match the clusters again."""
        return cls(
            clusters.points.astype(np.float32),
            np.minimum(clusters.counts, MOST_RETURNS).astype(np.uint16),
            clusters.starts.astype(np.int32),
        )

    def unpack(self, knot_step_m: float, sigma_m: float, *, fewest: int = 0) -> Clusters:
        """The clusters again, with their tangents, but for those of fewer raw returns."""
        points, counts = np.empty(self.points.shape), np.empty(len(self.points))
        starts = np.empty(len(self.starts), np.int64)
        kept = _unpack(self.points, self.counts, self.starts, fewest, points, counts, starts)
        n = int(starts[kept])
        return Clusters.with_tangents(
            points[:n], counts[:n], starts[: kept + 1], knot_step_m, sigma_m
        )


@lean
def _unpack(
    packed_points: NDArray[np.float32],
    packed_counts: NDArray[np.uint16],
    packed_starts: NDArray[np.int32],
    fewest: int,
    points: Points,
    counts: Vector,
    starts: NDArray[np.int64],
) -> int:
    """Write the clusters of at least `fewest` returns; their number."""
    kept = n = 0
    starts[0] = 0
    for c in range(len(packed_starts) - 1):
        returns = 0.0
        m = n
        for j in range(packed_starts[c], packed_starts[c + 1]):
            points[m, 0], points[m, 1] = packed_points[j, 0], packed_points[j, 1]
            counts[m] = packed_counts[j]
            returns += packed_counts[j]
            m += 1
        if returns >= fewest:
            n = m
            kept += 1
            starts[kept] = n
    return kept
