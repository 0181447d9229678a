"""One scan as the levels of the ladder see it."""

from __future__ import annotations

from bsmap_cli.mapping.fitting import FittingSettings
from bsmap_cli.mapping.segmentation import Clusters, SegmentationSettings, find_clusters
from bsmap_cli.sensor.gate import Returns


def coarser_levels(
    finest: Clusters, ladder: tuple[float, ...], fitting: FittingSettings, sigma_m: float
) -> list[Clusters]:
    """Clusters for each knot step, coarse to fine, from those of the finest."""
    levels = [finest]
    for step in reversed(ladder[:-1]):
        levels.append(levels[-1].coarser(step, fitting.thinning * step, sigma_m))
    return levels[::-1]


def scan_levels(
    returns: Returns,
    ladder: tuple[float, ...],
    segmentation: SegmentationSettings,
    fitting: FittingSettings,
    sigma_m: float,
) -> list[Clusters]:
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
    return coarser_levels(found[0], ladder, fitting, sigma_m)
