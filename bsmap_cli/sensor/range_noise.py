"""How noisy the ranges are, told from the scans themselves."""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.sensor.gate import SensorSettings, range_limits
from bsmap_cli.sensor.scan import Scan

SCANS = 15  # the deviation is settled after so many
LARGEST, UNKNOWN = 0.5, 0.1  # bound and first guess of the deviation [finest knot steps]


def estimate_range_sigma(scan: Scan, settings: SensorSettings, knot_step_m: float) -> float | None:
    """Deviation of the range noise [m] from second differences of neighbouring ranges.

    A smooth surface leaves next to nothing in a second difference; noise leaves sqrt(6) sigma.
    The median ignores edges. None where the scan has too few returns to tell.
    """
    near, far = range_limits(scan, settings, knot_step_m)
    ranges = scan.ranges_m.astype(np.float64)
    ranges[~((ranges >= near) & (ranges <= far))] = np.nan
    second = ranges[:-2] - 2.0 * ranges[1:-1] + ranges[2:]
    second = np.abs(second[np.isfinite(second)])
    if len(second) < 30:
        return None
    return float(np.median(second)) / (0.6745 * math.sqrt(6.0))


class RangeNoise:
    """Deviation of the range noise: the setting, or the median over the first scans that tell.

    One odd scan at the start must not decide, and no estimate exceeds half a knot step: beyond
    that the scans are not of surfaces.
    """

    def __init__(self, settings: SensorSettings, knot_step_m: float) -> None:
        self._settings = settings
        self._knot_step_m = knot_step_m
        self._estimates: list[float] = []
        self.sigma_m = settings.range_sigma_m or UNKNOWN * knot_step_m

    def observe(self, scan: Scan) -> float:
        """Take in one scan; the deviation [m] from now on."""
        if self._settings.range_sigma_m is None and len(self._estimates) < SCANS:
            estimate = estimate_range_sigma(scan, self._settings, self._knot_step_m)
            if estimate is not None:
                self._estimates.append(estimate)
                median = float(np.median(self._estimates))
                self.sigma_m = min(median, LARGEST * self._knot_step_m)
        return self.sigma_m
