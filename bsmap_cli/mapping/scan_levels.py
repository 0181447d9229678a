"""One scan as the levels of the ladder see it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bsmap_cli.geometry.se2 import Vector
from bsmap_cli.mapping.fitting import FittingSettings
from bsmap_cli.mapping.levels import Levels
from bsmap_cli.mapping.segmentation import (
    Clusters,
    SegmentationRule,
    find_clusters,
    segmentation_rule,
)
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


class Segmenter:
    """Segments scans at the finest knot step, eq. (3), and widens the bins for the coarser ones.

    With `segmentation.each_level` every knot step is segmented on its own, as in the paper.
    """

    def __init__(self, settings: MappingSettings) -> None:
        self._settings = settings
        self._lidar: tuple[object, ...] = ()
        self._rules: list[SegmentationRule] = []

    def levels(
        self, scan: Scan, sigma_m: float, twist_body: Vector = STANDING
    ) -> Sequence[Clusters]:
        """One scan as the levels of the ladder see it; `twist_body` as in `find_clusters`."""
        settings = self._settings
        lidar = (
            sigma_m,
            scan.angle_min_rad,
            scan.angle_increment_rad,
            len(scan.ranges_m),
            scan.range_min_m,
            scan.range_max_m,
            scan.time_increment_s,
            scan.pose_base_laser,
        )
        if lidar != self._lidar:  # seldom
            self._lidar, self._rules = lidar, self._rules_for(scan, sigma_m)
        if settings.segmentation.each_level:
            return [find_clusters(scan.ranges_m, rule, twist_body) for rule in self._rules]
        finest = find_clusters(scan.ranges_m, self._rules[0], twist_body)
        return ScanLevels(finest, settings.ladder, settings.fitting, sigma_m)

    def _rules_for(self, scan: Scan, sigma_m: float) -> list[SegmentationRule]:
        settings = self._settings
        ladder = settings.ladder
        fan = fan_of(scan, settings.sensor, ladder[-1])
        return [
            segmentation_rule(
                fan,
                settings.segmentation,
                knot_step_m=step,
                bin_m=settings.fitting.thinning * step,
                sigma_m=sigma_m,
            )
            for step in (ladder if settings.segmentation.each_level else ladder[-1:])
        ]
