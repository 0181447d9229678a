"""From where finished submaps were seen: which of them may show what is seen from here."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import kernel
from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.slam.edges import Integers
from bsmap_cli.slam.submap import Submap

EVERY = 4  # a viewpoint of so many is kept: keyframes lie close together


@kernel
def _nearest(
    poses: Points,
    x: float,
    y: float,
    extents_m: Vector,
    points: Points,
    starts: Integers,
    view_m: float,
    reach_m: Vector,
    next_try_m: Vector,
    travelled_m: float,
    nearest: Integers,
) -> int:
    """Write the nearest submaps that may show what is seen; their number."""
    found = 0
    ways = np.empty(len(nearest))
    for k in range(len(reach_m)):
        within = view_m + reach_m[k]
        dx, dy = x - poses[k, 0], y - poses[k, 1]
        if next_try_m[k] > travelled_m or math.hypot(dx, dy) > extents_m[k] + within:
            continue
        cos, sin = math.cos(poses[k, 2]), math.sin(poses[k, 2])
        seen_x, seen_y = cos * dx + sin * dy, cos * dy - sin * dx
        away = math.inf
        for p in range(starts[k], starts[k + 1]):
            way = math.hypot(points[p, 0] - seen_x, points[p, 1] - seen_y)
            away = min(away, way / within)
        if away >= 1.0:
            continue
        place = min(found, len(nearest))
        while place > 0 and ways[place - 1] > away:
            if place < len(nearest):
                ways[place], nearest[place] = ways[place - 1], nearest[place - 1]
            place -= 1
        if place < len(nearest):
            ways[place], nearest[place] = away, k
            found = min(found + 1, len(nearest))
    return found


def median_range(points: NDArray[np.float32]) -> float:
    """Half of (n, 2) points lie farther away [m]; 0 without any."""
    n = len(points)
    if n == 0:
        return 0.0
    middle = (n - 1) // 2, n // 2
    ranges = np.hypot(points[:, 0], points[:, 1])
    ranges.partition(middle)
    return 0.5 * (float(ranges[middle[0]]) + float(ranges[middle[1]]))


class Viewpoints:
    """Those of all finished submaps, one submap after the other."""

    def __init__(self) -> None:
        self._extents_m = np.empty(0)
        self._points = np.empty((0, 2))
        self._starts = np.zeros(1, np.int64)

    def __len__(self) -> int:
        return len(self._extents_m)

    def add(self, submap: Submap) -> None:
        """One submap more that has been finished."""
        seen_from = np.array(submap.viewpoints[::EVERY]).reshape(-1, 2)
        self._extents_m = np.append(self._extents_m, submap.extent_m)
        self._points = np.concatenate((self._points, seen_from))
        self._starts = np.append(self._starts, len(self._points))

    def nearest(
        self,
        poses: Points,
        here: SE2,
        view_m: float,
        reach_m: Vector,
        *,
        next_try_m: Vector,
        travelled_m: float,
        most: int,
    ) -> list[int]:
        """The submaps that may show what is seen from here, at most so many, nearest first.

        How near one is counts as a share of what matters: how far one sees from here and how far
        the submap may lie off. Those whose next try is due only farther on the way are left out.
        poses : (n, 3) of the submaps in the frame of `here`.
        """
        found = np.empty(most, np.int64)
        count = _nearest(
            poses,
            here.x,
            here.y,
            self._extents_m,
            self._points,
            self._starts,
            view_m,
            reach_m,
            next_try_m,
            travelled_m,
            found,
        )
        nearest: list[int] = found[:count].tolist()
        return nearest
