"""The clusters of a scan as they are kept for long: every keyframe has them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import lean
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.scan_batch import ScanBatch
from bsmap_cli.mapping.segmentation import Clusters

MOST_RETURNS = 65535  # that a count can tell
BATCH = 64  # scans that are unpacked at a time, so that memory does not grow with the log


class CompactClusters(NamedTuple):
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

    def unpack(self, knot_step_m: float, sigma_m: float) -> Clusters:
        """The clusters again, with their tangents."""
        return unpack_scans([self], knot_step_m, sigma_m).clusters


def unpack_scans(
    packed: Sequence[CompactClusters], knot_step_m: float, sigma_m: float, *, fewest: int = 0
) -> ScanBatch:
    """The clusters of packed scans, with their tangents, but for those of fewer raw returns."""
    packed_points = np.concatenate([scan.points for scan in packed])
    packed_starts = np.concatenate([scan.starts for scan in packed])
    lengths = np.array([len(scan.starts) for scan in packed])
    points, counts = np.empty(packed_points.shape), np.empty(len(packed_points))
    starts, firsts = np.empty(len(packed_starts), np.int64), np.empty(len(packed) + 1, np.int64)
    kept = _unpack(
        packed_points,
        np.concatenate([scan.counts for scan in packed]),
        packed_starts,
        lengths,
        fewest,
        points,
        counts,
        starts,
        firsts,
    )
    n = int(starts[kept])
    clusters = Clusters.with_tangents(
        points[:n], counts[:n], starts[: kept + 1], knot_step_m, sigma_m
    )
    return ScanBatch(clusters, firsts)


def unpacked_scans(
    packed: Sequence[CompactClusters], knot_step_m: float, sigma_m: float
) -> Iterator[Clusters]:
    """Scan after scan of any number."""
    for begin in range(0, len(packed), BATCH):
        yield from unpack_scans(packed[begin : begin + BATCH], knot_step_m, sigma_m)


@lean
def _unpack(
    packed_points: NDArray[np.float32],
    packed_counts: NDArray[np.uint16],
    packed_starts: NDArray[np.int32],
    lengths: NDArray[np.int64],
    fewest: int,
    points: Points,
    counts: Vector,
    starts: NDArray[np.int64],
    firsts: NDArray[np.int64],
) -> int:
    """Write the clusters of at least `fewest` returns; their number.

    lengths : of the starts of each scan, which begin at 0 with each.
    """
    kept = n = c = base = 0
    starts[0] = 0
    for s in range(len(lengths)):
        firsts[s] = kept
        for _ in range(lengths[s] - 1):
            returns = 0.0
            m = n
            for j in range(base + packed_starts[c], base + packed_starts[c + 1]):
                points[m, 0], points[m, 1] = packed_points[j, 0], packed_points[j, 1]
                counts[m] = packed_counts[j]
                returns += packed_counts[j]
                m += 1
            if returns >= fewest:
                n = m
                kept += 1
                starts[kept] = n
            c += 1
        base += packed_starts[c]
        c += 1
    firsts[len(lengths)] = kept
    return kept
