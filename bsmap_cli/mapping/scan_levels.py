"""One scan as the levels of the ladder see it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bsmap_cli.geometry.se2 import Vector
from bsmap_cli.mapping.fitting import FittingSettings
from bsmap_cli.mapping.levels import Levels
from bsmap_cli.mapping.segmentation import Clusters, find_clusters
from bsmap_cli.sensor.gate import STANDING, fan_of
from bsmap_cli.sensor.scan import Scan

if TYPE_CHECKING:
    from bsmap_cli.mapping.mapping_settings import MappingSettings


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
    scan: Scan,
    settings: MappingSettings,
    sigma_m: float,
    twist_body: Vector = STANDING,
) -> Sequence[Clusters]:
    """Segment at the finest knot step, eq. (3), and widen the bins for the coarser ones.

    With `segmentation.each_level` every knot step is segmented on its own, as in the paper.
    twist_body : as in `find_clusters`.
    """
    ladder, thinning = settings.ladder, settings.fitting.thinning
    fan = fan_of(scan, settings.sensor, ladder[-1])
    each = settings.segmentation.each_level
    found = [
        find_clusters(
            scan,
            fan,
            settings.segmentation,
            knot_step_m=step,
            bin_m=thinning * step,
            sigma_m=sigma_m,
            twist_body=twist_body,
        )
        for step in (ladder if each else ladder[-1:])
    ]
    return found if each else ScanLevels(found[0], ladder, settings.fitting, sigma_m)
