"""Map building with known poses: Algorithm 1."""

from __future__ import annotations

import math

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.cleanup import tidy
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.evidence import View, remove_unseen
from bsmap_cli.mapping.fading import fade
from bsmap_cli.mapping.freeze import freeze_level
from bsmap_cli.mapping.insertion import insert_clusters
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.scan_levels import Segmenter
from bsmap_cli.mapping.trimming import remove_guessed
from bsmap_cli.sensor.range_noise import RangeNoise
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.sight import find_sight

VIEW_STEPS, VIEW_TURN = 2.0, math.radians(7.0)  # from one kept view to the next [finest knot steps]


class Mapper:
    """Builds one map a knot step from scans with known poses."""

    def __init__(self, settings: MappingSettings) -> None:
        self.settings = settings.without_faint()  # the poses are known: nothing to guide
        self.levels = [CurveMap(step, settings.degree) for step in settings.ladder]
        self.noise = RangeNoise(settings.sensor, settings.ladder[-1])
        self._segmenter = Segmenter(self.settings)
        self._views: list[View] = []
        self._last_view: SE2 | None = None

    def insert(self, scan: Scan, pose_map_base: SE2) -> None:
        """Algorithm 1: one scan enters the map at its pose."""
        settings, pose = self.settings, pose_map_base.as_array()
        self.noise.observe(scan)
        clusters = self._segmenter.levels(scan, self.noise.sigma_m)
        for level, seen in zip(self.levels, clusters, strict=True):
            insert_clusters(level, seen, pose, settings)
        self._look(scan, pose_map_base)

    def _look(self, scan: Scan, pose_map_base: SE2) -> None:
        """Lower at once the weights of what the scan looks through, or keep it for the end."""
        settings, finest = self.settings, self.settings.ladder[-1]
        method = settings.visibility.method
        if method == "fade":
            sight = find_sight(scan, settings.sensor, finest)
            for level in self.levels:
                fade(
                    level,
                    sight,
                    pose_map_base.as_array(),
                    sigma_m=self.noise.sigma_m,
                    min_length=settings.segmentation.min_length,
                )
        elif method == "evidence" and self._is_new_view(pose_map_base):
            self._last_view = pose_map_base
            sight = find_sight(scan, settings.sensor, finest)
            self._views.append((sight, pose_map_base.as_array()))

    def _is_new_view(self, pose_map_base: SE2) -> bool:
        if self._last_view is None:
            return True
        moved = self._last_view.inverse() @ pose_map_base
        way = math.hypot(moved.x, moved.y)
        return way >= VIEW_STEPS * self.settings.ladder[-1] or abs(moved.theta) >= VIEW_TURN

    def document(self) -> MapDocument:
        """The map as it stands, tidied, without what later views contradict."""
        if self._views:
            for level in self.levels:
                remove_unseen(
                    level,
                    self._views,
                    sigma_m=self.noise.sigma_m,
                    settings=self.settings.visibility,
                    min_length=self.settings.segmentation.min_length,
                )
        if self.settings.association.method == "curve":
            for level in self.levels:
                remove_guessed(level, min_length=self.settings.segmentation.min_length)
                tidy(level, min_length=self.settings.segmentation.min_length)
        cap = self.settings.merging.max_weight
        return MapDocument(
            degree=self.settings.degree,
            max_weight=cap,
            levels=tuple(freeze_level(level, max_weight=cap) for level in self.levels),
        )
