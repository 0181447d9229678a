"""The clusters of several scans at once: calls cost more than what they do for one scan."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.mapping.segmentation import Clusters


@dataclass(frozen=True, slots=True)
class ScanBatch:
    """clusters : of all scans, one scan after the other; firsts : (s + 1,) first cluster of each
    scan, and the end."""

    clusters: Clusters
    firsts: NDArray[np.int64]

    @classmethod
    def of_one(cls, clusters: Clusters) -> ScanBatch:
        """A scan alone."""
        return cls(clusters, np.array([0, len(clusters)]))

    def __len__(self) -> int:
        return len(self.firsts) - 1

    @property
    def most_points(self) -> int:
        """Of the largest scan."""
        if len(self.firsts) == 2:
            return len(self.clusters.points)
        return int(np.diff(self.clusters.starts[self.firsts]).max(initial=0))

    def __iter__(self) -> Iterator[Clusters]:
        """The scans one by one: views."""
        of_all = self.clusters
        bounds = of_all.starts[self.firsts].tolist()
        firsts = self.firsts.tolist()
        for k in range(len(self)):
            part = slice(bounds[k], bounds[k + 1])
            starts = of_all.starts[firsts[k] : firsts[k + 1] + 1] - bounds[k]
            yield Clusters(of_all.points[part], of_all.tangents[part], of_all.counts[part], starts)

    def coarser(self, knot_step_m: float, bin_m: float, sigma_m: float) -> ScanBatch:
        """As a coarser level of the ladder sees them."""
        return ScanBatch(self.clusters.coarser(knot_step_m, bin_m, sigma_m), self.firsts)
