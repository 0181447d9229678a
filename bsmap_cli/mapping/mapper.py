"""Map building with known poses: Algorithm 1."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.alignment import AlignmentSettings
from bsmap_cli.mapping.association import AssociationSettings
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.fitting import FittingSettings
from bsmap_cli.mapping.freeze import freeze_level
from bsmap_cli.mapping.insertion import insert_clusters
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.merging import MergingSettings
from bsmap_cli.mapping.segmentation import Clusters, SegmentationSettings, find_clusters
from bsmap_cli.sensor.gate import Returns, SensorSettings, estimate_range_sigma, find_returns
from bsmap_cli.sensor.scan import Scan


@dataclass(frozen=True, slots=True, kw_only=True)
class MappingSettings:
    """What Sec. III needs; `ladder` holds the knot steps Delta [m], coarse to fine."""

    degree: int = 3
    ladder: tuple[float, ...] = (0.4, 0.2, 0.1)
    sensor: SensorSettings = field(default_factory=SensorSettings)
    segmentation: SegmentationSettings = field(default_factory=SegmentationSettings)
    association: AssociationSettings = field(default_factory=AssociationSettings)
    fitting: FittingSettings = field(default_factory=FittingSettings)
    alignment: AlignmentSettings = field(default_factory=AlignmentSettings)
    merging: MergingSettings = field(default_factory=MergingSettings)


class Mapper:
    """Builds one map a knot step from scans with known poses."""

    def __init__(self, settings: MappingSettings) -> None:
        self.settings = settings
        self.levels = [CurveMap(step, settings.degree) for step in settings.ladder]
        self.sigma_m = settings.sensor.range_sigma_m

    def insert(self, scan: Scan, pose_map_base: SE2) -> None:
        """Algorithm 1: one scan enters the map at its pose."""
        finest = self.settings.ladder[-1]
        if self.sigma_m is None:
            self.sigma_m = estimate_range_sigma(scan, self.settings.sensor, finest)
        returns = find_returns(scan, self.settings.sensor, finest)
        self.insert_returns(returns, pose_map_base.as_array())

    def clusters(self, returns: Returns, knot_step_m: float) -> Clusters:
        """The scan's clusters as one level sees them, eq. (3)."""
        return find_clusters(
            returns,
            self.settings.segmentation,
            knot_step_m=knot_step_m,
            bin_m=self.settings.fitting.thinning * knot_step_m,
            sigma_m=self.sigma_m or 0.0,
        )

    def insert_returns(self, returns: Returns, pose_map_base: np.ndarray) -> None:
        """Insert what `find_returns` gave, into every level."""
        for level in self.levels:
            insert_clusters(
                level,
                self.clusters(returns, level.knot_step_m),
                pose_map_base,
                segmentation=self.settings.segmentation,
                association=self.settings.association,
                fitting=self.settings.fitting,
                merging=self.settings.merging,
            )

    def document(self) -> MapDocument:
        """The map as it stands."""
        cap = self.settings.merging.max_weight
        return MapDocument(
            degree=self.settings.degree,
            max_weight=cap,
            levels=tuple(freeze_level(level, max_weight=cap) for level in self.levels),
        )
