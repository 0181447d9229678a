"""One scan as the levels of the ladder see it."""

from __future__ import annotations

from collections.abc import Sequence

from bsmap_cli.mapping.fitting import FittingSettings
from bsmap_cli.mapping.levels import Levels
from bsmap_cli.mapping.segmentation import Clusters, SegmentationSettings, find_clusters
from bsmap_cli.sensor.gate import Returns


class ScanLevels(Levels[Clusters]):
    """Clusters for each knot step, coarse to fine; coarser ones are made when asked for.

    A scan that is tracked at the finest level, and is no keyframe, never needs them.
    """

    def __init__(
        self, finest: Clusters, ladder: Sequence[float], fitting: FittingSettings, sigma_m: float
    ) -> None:
        self._levels: list[Clusters | None] = [None] * (len(ladder) - 1) + [finest]
        self._ladder, self._thinning, self._sigma_m = ladder, fitting.thinning, sigma_m

    def __len__(self) -> int:
        return len(self._levels)

    def _at(self, k: int) -> Clusters:
        level = self._levels[k]
        if level is None:
            step = self._ladder[k]
            level = self._at(k + 1).coarser(step, self._thinning * step, self._sigma_m)
            self._levels[k] = level
        return level


def scan_levels(
    returns: Returns,
    ladder: tuple[float, ...],
    segmentation: SegmentationSettings,
    fitting: FittingSettings,
    sigma_m: float,
) -> Sequence[Clusters]:
    """Segment at the finest knot step, eq. (3), and widen the bins for the coarser ones.

    With `segmentation.each_level` every knot step is segmented on its own, as in the paper.
    """
    steps = ladder if segmentation.each_level else ladder[-1:]
    found = [
        find_clusters(
            returns,
            segmentation,
            knot_step_m=step,
            bin_m=fitting.thinning * step,
            sigma_m=sigma_m,
        )
        for step in steps
    ]
    if segmentation.each_level:
        return found
    return ScanLevels(found[0], ladder, fitting, sigma_m)
