"""How noisy the ranges are, told from the scans themselves."""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.sensor.gate import SensorSettings, range_limits
from bsmap_cli.sensor.scan import Scan

SCANS = 15  # estimates that are kept
LARGEST, UNKNOWN = 0.5, 0.1  # bound and first guess of the deviation [finest knot steps]


def estimate_range_sigma(scan: Scan, settings: SensorSettings, knot_step_m: float) -> float | None:
    """Deviation of the range noise [m] from how far returns lie off their neighbours' line.

    On a straight wall, 1 / range is a sine of the beam's angle: what two neighbours say of the
    range between them is exact however the beam meets the wall. Only the closer half of all
    neighbours is asked, as niches and bends fall between beams that lie far apart; the median
    ignores edges. None where the scan has too few returns to tell.
    """
    near, far = range_limits(scan, settings, knot_step_m)
    ranges = scan.ranges_m.astype(np.float64)
    ranges[~((ranges >= near) & (ranges <= far) & (ranges > 0.0))] = np.nan
    before, behind = ranges[:-2], ranges[2:]
    cos = math.cos(scan.angle_increment_rad)
    told = 2.0 * cos * before * behind / (before + behind)
    slopes = (told / before) ** 4 + (told / behind) ** 4
    off = np.abs(ranges[1:-1] - told) / np.sqrt(1.0 + slopes / (2.0 * cos) ** 2)
    gap = np.hypot(behind - before, scan.angle_increment_rad * (before + behind))
    known = np.isfinite(off)
    if known.sum() < 30:
        return None
    off = off[known][gap[known] <= np.median(gap[known])]
    return float(np.median(off)) / 0.6745


class RangeNoise:
    """Deviation of the range noise: the setting, or the median over scans spread over the log.

    Neither one odd scan nor an odd place to start from must decide: whenever enough estimates
    have been gathered every second one is dropped, and from then on half as many are taken. No
    estimate exceeds half a knot step: beyond that the scans are not of surfaces.
    """

    def __init__(self, settings: SensorSettings, knot_step_m: float) -> None:
        self._settings = settings
        self._knot_step_m = knot_step_m
        self._estimates: list[float] = []
        self._every = 1
        self._scans = 0
        self.sigma_m = settings.range_sigma_m or UNKNOWN * knot_step_m

    def observe(self, scan: Scan) -> float:
        """Take in one scan; the deviation [m] from now on."""
        due = self._scans % self._every == 0
        self._scans += 1
        if self._settings.range_sigma_m is None and due:
            estimate = estimate_range_sigma(scan, self._settings, self._knot_step_m)
            if estimate is not None:
                self._take(estimate)
        return self.sigma_m

    def _take(self, estimate: float) -> None:
        self._estimates.append(estimate)
        self.sigma_m = min(float(np.median(self._estimates)), LARGEST * self._knot_step_m)
        if len(self._estimates) > SCANS:
            self._estimates = self._estimates[::2]
            self._every *= 2
