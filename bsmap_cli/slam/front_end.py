"""What tracking sees of a scan: its returns, cut into clusters for each level of the ladder."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bsmap_cli.geometry.compiled_poses import Pose
from bsmap_cli.geometry.se2 import Vector
from bsmap_cli.mapping.scan_levels import Segmenter
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.sensor.gate import STANDING
from bsmap_cli.sensor.range_noise import RangeNoise
from bsmap_cli.sensor.scan import Scan

if TYPE_CHECKING:
    from bsmap_cli.slam.slam_settings import SlamSettings


class FrontEnd:
    """Turns scans into clusters, in the order of the log; learns the noise on the way.

    sigma_m : deviation of the range noise [m], after the last scan.
    twist : (3,) velocity (vx, vy [m/s], omega [rad/s]) of the base during the last scan; none for
    logs that do not say when each beam was fired.
    """

    def __init__(self, settings: SlamSettings) -> None:
        self._segmenter = Segmenter(settings)
        self._noise = RangeNoise(settings.sensor, settings.ladder[-1])
        self.twist = STANDING
        self._last_stamp_ns: int | None = None

    @property
    def sigma_m(self) -> float:
        """Deviation of the range noise [m]."""
        return self._noise.sigma_m

    def clusters(self, scan: Scan, last_step: Pose) -> Sequence[Clusters]:
        """Clusters of one scan, coarse to fine; `last_step` is the motion since the scan before."""
        self._noise.observe(scan)
        self.twist = self._twist(scan, last_step)
        self._last_stamp_ns = scan.stamp_ns
        return self._segmenter.levels(scan, self.sigma_m, self.twist)

    def _twist(self, scan: Scan, last_step: Pose) -> Vector:
        if self._last_stamp_ns is None:
            return STANDING
        elapsed = 1e-9 * (scan.stamp_ns - self._last_stamp_ns)
        sweep = abs(scan.time_increment_s) * len(scan.ranges_m)
        if not 0.0 < sweep <= 1.5 * elapsed:
            return STANDING
        return np.array(last_step) / elapsed
