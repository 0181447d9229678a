"""Where a search looks, and what it finds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector


@dataclass(frozen=True, slots=True)
class Peak:
    """A pose (3,) in the submap frame and its score in 0..1."""

    pose: Vector
    score: float


@dataclass(frozen=True, slots=True)
class Window:
    """Where to look: `centre` (3,) in the submap frame, half widths [m], [rad] (pi: all round)."""

    centre: Vector
    reach_m: float
    reach_rad: float


def heights_for(reach: int) -> int:
    """Heights of a pyramid whose largest blocks, two by two, hold a window of so many cells."""
    return 1 + max(0, math.ceil(math.log2(reach + 0.5)))


@lru_cache(maxsize=64)
def _offsets(steps: int) -> NDArray[np.int64]:
    """0, -1, 1, -2, 2 ...: what lies near the guess first, as a good score spares much else."""
    offsets = np.arange(1, 2 * steps + 2) // 2
    offsets[1::2] *= -1
    return offsets


def window_grid(
    cell_m: float,
    points: Points,
    window: Window,
    barred: Peak | None,
    apart_m: float,
    apart_rad: float,
) -> tuple[Vector, Points, int]:
    """The poses of a window: angles, what is barred at each (x, y, radius), reach; in cells.

    The farthest point moves by a cell from one angle to the next.
    """
    radius = float(np.hypot(points[:, 0], points[:, 1]).max())
    turn = cell_m / max(radius, 4.0 * cell_m)
    steps = math.ceil(min(window.reach_rad, math.pi) / turn)
    angles = window.centre[2] + _offsets(steps) * turn
    discs = np.zeros((len(angles), 3))
    if barred is not None:
        discs[:, :2] = (barred.pose[:2] - window.centre[:2]) / cell_m
        turned = np.remainder(angles - barred.pose[2] + math.pi, math.tau) - math.pi
        discs[np.abs(turned) < apart_rad, 2] = apart_m / cell_m
    return angles, discs, math.ceil(window.reach_m / cell_m)
