"""A part of the map that is rigid: a stretch of keyframes and the curves they made."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.fading import fade
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.sensor.sight import Sight
from bsmap_cli.settings import setting
from bsmap_cli.slam.keyframes import Keyframe
from bsmap_cli.slam.likelihood import Likelihood, build_likelihood
from bsmap_cli.slam.submap_levels import SubmapLevels


@dataclass(frozen=True, slots=True, kw_only=True)
class SubmapSettings:
    """How much goes into one submap."""

    keyframes: int = setting(
        40, "a submap is finished after so many; the next one starts at half of them", minimum=4
    )


class Submap:
    """Curves in the frame of the submap's first keyframe, one map a knot step, coarse to fine.

    pose_local : the submap in the local frame of tracking, which drifts.
    viewpoints : where its keyframes stood, submap frame [m]; none is farther out than `extent_m`.
    """

    def __init__(self, index: int, pose_local: SE2, settings: MappingSettings) -> None:
        self.index = index
        self.pose_local = pose_local
        self._drawn = SubmapLevels(settings)
        self.levels: Sequence[CurveMap] = self._drawn
        self.keyframes: list[int] = []
        self.viewpoints: list[tuple[float, float]] = []
        self.extent_m = 0.0
        self._settings = settings
        self._likelihood: tuple[int, Likelihood] | None = None

    def to_submap(self, pose_local: SE2) -> SE2:
        """A pose of the local frame, in the submap's."""
        return pose_local.relative_to(self.pose_local)

    def insert(self, keyframe: Keyframe, clusters: Sequence[Clusters], sigma_m: float) -> None:
        """Let a keyframe change the curves."""
        pose = self.to_submap(keyframe.pose_local)
        self._drawn.insert(clusters, keyframe.clusters, pose.as_array(), sigma_m)
        self.keyframes.append(keyframe.index)
        self.viewpoints.append((pose.x, pose.y))
        self.extent_m = max(self.extent_m, math.hypot(pose.x, pose.y))

    def fade(self, sight: Sight, pose_submap_base: SE2, sigma_m: float) -> None:
        """Let what a keyframe looks through lose weight."""
        for level in self.levels:
            fade(
                level,
                sight,
                pose_submap_base.as_array(),
                sigma_m=sigma_m,
                min_length=self._settings.segmentation.min_length,
            )

    def likelihood(self, *, cell_m: float, heights: int) -> Likelihood:
        """What searches look at, for the curves as they stand; kept until they change.

        The pyramid has `heights` levels, or more where it has been asked for more.
        """
        drawn, count = self._likelihood, len(self.keyframes)
        if drawn is None or drawn[0] != count or len(drawn[1].grids) < heights:
            built = build_likelihood(self.levels[-1], cell_m=cell_m, heights=heights)
            drawn = self._likelihood = (count, built)
        return drawn[1]

    def finish(self) -> None:
        """It will hold no further keyframe: give back what only a growing one needs."""
        self._drawn.finish()
        self.forget_likelihood()

    def fold(self) -> None:
        """Give back what the curves of a finished submap are made ready with when asked for."""
        self._drawn.fold()

    def forget_likelihood(self) -> None:
        """Give the memory back."""
        self._likelihood = None
