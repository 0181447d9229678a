"""The curves of a submap at each knot step, the coarser ones drawn when they are asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bsmap_cli.geometry.se2 import Vector
from bsmap_cli.mapping.compact_clusters import CompactClusters
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.insertion import draw_scans, insert_clusters
from bsmap_cli.mapping.levels import Levels
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.slam.keyframes import every_nth


class SubmapLevels(Levels[CurveMap]):
    """Curve maps, coarse to fine.

    Most scans are tracked on the finest level alone, and in most submaps no loop is sought: their
    coarser levels would be drawn for nobody.
    """

    def __init__(self, settings: MappingSettings) -> None:
        self._settings = settings
        self._levels = [CurveMap(step, settings.degree) for step in settings.ladder]
        self._inserted: list[tuple[CompactClusters, Vector]] = []
        self._sigma_m = 0.0
        self._drawn = [0] * len(self._levels)  # how many of these each level holds
        self._finished = False

    def __len__(self) -> int:
        return len(self._levels)

    def _at(self, k: int) -> CurveMap:
        if self._drawn[k] < len(self._inserted):
            self._draw_waiting(k)
        return self._open(k)

    def _open(self, k: int) -> CurveMap:
        if self._levels[k].folded:
            self._levels[k].unfold()
        return self._levels[k]

    def insert(
        self,
        clusters: Sequence[Clusters],
        packed: CompactClusters,
        pose_submap_base: Vector,
        sigma_m: float,
    ) -> None:
        """Let a keyframe change the finest level now; `packed` holds its finest clusters."""
        if self._settings.segmentation.each_level:  # coarse clusters do not follow from fine ones
            for level, seen in zip(self._levels, clusters, strict=True):
                insert_clusters(level, seen, pose_submap_base, self._settings)
            return
        insert_clusters(self._levels[-1], clusters[-1], pose_submap_base, self._settings)
        self._inserted.append((packed, pose_submap_base))
        self._sigma_m = sigma_m
        self._drawn[-1] += 1

    def finish(self) -> None:
        """Nothing more will be inserted: what waits is drawn from as few keyframes as it takes.

        At the end of a map that grows, a scan needs them all.
        """
        self._finished = True
        self.fold()

    def fold(self) -> None:
        """Give back what can be made again, where nothing more is inserted."""
        for level in self._levels:
            if self._finished and not level.folded:
                level.fold()

    def _draw_waiting(self, k: int) -> None:
        ladder, level, drawn = self._settings.ladder, self._open(k), self._drawn[k]
        apart = every_nth(ladder[k], ladder[-1]) if self._finished else 1
        waiting = self._inserted[drawn + -drawn % apart :: apart]
        if waiting:
            packed, poses = zip(*waiting, strict=True)
            above = len(self) - 1 - k
            # one size for all that comes, where nothing more does: growing costs more than drawing
            level.reserve(len(self._levels[-1].arrays.weights) if self._finished else 0)
            draw_scans(level, packed, np.array(poses), self._settings, self._sigma_m, above=above)
        self._drawn[k] = len(self._inserted)
        if self._finished:
            level.trim()
