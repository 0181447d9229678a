"""Beams that meet the same thing near by in all scans of a drive: the robot sees itself."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.sensor.scan import Scan

FARTHEST_M = 0.6
"""Farther things that stand still before a beam are walls along which the robot drives."""

_STEADY_M = 0.05
_MOVED_M = 0.5
_SEEN_SHARE = 0.95
_FEWEST_SCANS = 50
_BRIDGED_BEAMS = 3


class Sector(NamedTuple):
    """From and to [whole degrees, laser frame], and how far away the thing is [m]."""

    from_deg: int
    to_deg: int
    range_m: float


class SteadyBeams:
    """Least and greatest range of each beam, of the scans that are as wide as the first one."""

    def __init__(self) -> None:
        self._first: Scan | None = None
        self._count = 0
        self._low = self._high = self._seen = np.zeros(0)

    def add(self, scan: Scan, ranges: NDArray[np.float64]) -> None:
        """Take a scan into account; ranges : [m], NaN where there is no return."""
        first = self._first
        if first is None:
            self._first = first = scan
            self._low, self._high = np.full((2, len(ranges)), np.nan)
            self._seen = np.zeros(len(ranges))
        if _shape(scan) != _shape(first):
            return
        self._count += 1
        self._low = np.fmin(self._low, ranges)
        self._high = np.fmax(self._high, ranges)
        self._seen += ~np.isnan(ranges)

    def sectors(self) -> list[Sector]:
        """Where the robot sees itself; nothing where it has hardly moved."""
        if self._first is None or self._count < _FEWEST_SCANS:
            return []
        spread = np.where(self._seen > 0.0, self._high - self._low, 0.0)
        near = (self._high <= FARTHEST_M) & (self._seen >= _SEEN_SHARE * self._count)
        steady = np.flatnonzero(near & (spread <= _STEADY_M))
        if not len(steady) or np.median(spread) < _MOVED_M:
            return []
        ends = np.flatnonzero(np.diff(steady) > _BRIDGED_BEAMS) + 1
        return [self._sector(part) for part in np.split(steady, ends)]

    def _sector(self, beams: NDArray[np.intp]) -> Sector:
        assert self._first is not None
        low, step = self._first.angle_min_rad, self._first.angle_increment_rad
        start, end = (math.degrees(low + step * beam) for beam in (beams[0] - 0.5, beams[-1] + 0.5))
        return Sector(math.floor(start), math.ceil(end), float(self._low[beams].min()))


def _shape(scan: Scan) -> tuple[str, int, float, float]:
    return scan.topic, len(scan.ranges_m), scan.angle_min_rad, scan.angle_increment_rad
