"""The settings of Sec. III, gathered from the files that use them."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Self

from bsmap_cli.mapping.alignment import AlignmentSettings
from bsmap_cli.mapping.association import AssociationSettings
from bsmap_cli.mapping.evidence import VisibilitySettings
from bsmap_cli.mapping.fitting import FittingSettings
from bsmap_cli.mapping.merging import MergingSettings
from bsmap_cli.mapping.segmentation import SegmentationSettings
from bsmap_cli.sensor.gate import SensorSettings


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
    visibility: VisibilitySettings = field(default_factory=VisibilitySettings)

    def without_faint(self) -> Self:
        """The same, without the clusters that only guide."""
        size = self.segmentation.min_points
        return replace(self, segmentation=replace(self.segmentation, faint_points=size))
