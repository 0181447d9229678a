"""Map building with known poses: Algorithm 1."""

from __future__ import annotations

from bsmap_cli.geometry.se2 import SE2, Vector
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.freeze import freeze_level
from bsmap_cli.mapping.insertion import insert_clusters
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.scan_levels import scan_levels
from bsmap_cli.sensor.gate import Returns, find_returns
from bsmap_cli.sensor.range_noise import RangeNoise
from bsmap_cli.sensor.scan import Scan


class Mapper:
    """Builds one map a knot step from scans with known poses."""

    def __init__(self, settings: MappingSettings) -> None:
        self.settings = settings
        self.levels = [CurveMap(step, settings.degree) for step in settings.ladder]
        self.noise = RangeNoise(settings.sensor, settings.ladder[-1])

    def insert(self, scan: Scan, pose_map_base: SE2) -> None:
        """Algorithm 1: one scan enters the map at its pose."""
        finest = self.settings.ladder[-1]
        self.noise.observe(scan)
        returns = find_returns(scan, self.settings.sensor, finest)
        self.insert_returns(returns, pose_map_base.as_array())

    def insert_returns(self, returns: Returns, pose_map_base: Vector) -> None:
        """Insert what `find_returns` gave, into every level."""
        settings = self.settings
        clusters = scan_levels(
            returns, settings.ladder, settings.segmentation, settings.fitting, self.noise.sigma_m
        )
        for level, seen in zip(self.levels, clusters, strict=True):
            insert_clusters(level, seen, pose_map_base, settings)

    def document(self) -> MapDocument:
        """The map as it stands."""
        cap = self.settings.merging.max_weight
        return MapDocument(
            degree=self.settings.degree,
            max_weight=cap,
            levels=tuple(freeze_level(level, max_weight=cap) for level in self.levels),
        )
