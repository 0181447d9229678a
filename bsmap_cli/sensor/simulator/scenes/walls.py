"""Walls with niches, pilasters and doorways, as floor plans have them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.world import Shapes, gather, polyline


@dataclass(frozen=True, slots=True)
class Niche:
    """The wall steps back by `depth_m` (forward where negative) for `width_m` round `at_m`."""

    at_m: float
    width_m: float = 0.9
    depth_m: float = 0.15


@dataclass(frozen=True, slots=True)
class Doorway:
    """The wall is open for `width_m` round `at_m`; its edges go `depth_m` back."""

    at_m: float
    width_m: float = 1.0
    depth_m: float = 0.15


def wall(start: Sequence[float], end: Sequence[float], *features: Niche | Doorway) -> Shapes:
    """A straight wall with the free side on its left; features in order along it."""
    length_m = math.dist(start, end)
    runs: list[list[tuple[float, float]]] = [[(0.0, 0.0)]]
    for feature in features:
        left, right = feature.at_m - feature.width_m / 2, feature.at_m + feature.width_m / 2
        runs[-1] += [(left, 0.0), (left, -feature.depth_m)]
        if isinstance(feature, Doorway):
            runs.append([])
        runs[-1] += [(right, -feature.depth_m), (right, 0.0)]
    runs[-1].append((length_m, 0.0))
    heading = math.atan2(end[1] - start[1], end[0] - start[0])
    return gather(polyline(*run) for run in runs).at(SE2(start[0], start[1], heading))
