"""Planar lidars as their data sheets describe them, and what noise makes of a true range."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bsmap_cli.geometry.se2 import Vector
from bsmap_cli.sensor.scan import Ranges


@dataclass(frozen=True, slots=True, kw_only=True)
class LidarModel:
    """One lidar.

    rate_hz : sweeps a second. turn_s : time for one full turn of its mirror [s].
    range_sigma_m : standard deviation of a range [m]; at least `range_sigma_share` of the range.
    outlier_share : beams that return any range at all. dropout_share : beams that never return.
    resolution_m : ranges are multiples of it; 0 for none.
    """

    name: str
    beams: int
    first_deg: float
    step_deg: float
    rate_hz: float
    range_min_m: float
    range_max_m: float
    turn_s: float
    range_sigma_m: float = 0.01
    range_sigma_share: float = 0.0
    outlier_share: float = 0.0
    dropout_share: float = 0.0
    resolution_m: float = 0.0

    @property
    def angle_min_rad(self) -> float:
        """Direction of the first beam: a float32 value."""
        return float(np.float32(math.radians(self.first_deg)))

    @property
    def angle_increment_rad(self) -> float:
        """From one beam to the next: a float32 value."""
        return float(np.float32(math.radians(self.step_deg)))

    @property
    def time_increment_s(self) -> float:
        """From one beam to the next."""
        return self.turn_s * self.step_deg / 360.0

    def beam_angles(self) -> Vector:
        """(n,) directions in the laser frame [rad]."""
        return self.angle_min_rad + self.angle_increment_rad * np.arange(
            self.beams, dtype=np.float64
        )

    def measure(self, true_ranges_m: Vector, random: np.random.Generator) -> Ranges:
        """What is reported: inf where nothing returns, -inf where it is too close (REP 117)."""
        hit = np.isfinite(true_ranges_m)
        ranges = np.where(hit, true_ranges_m, 0.0)
        sigma = np.maximum(self.range_sigma_m, self.range_sigma_share * ranges)
        ranges = np.where(hit, ranges + sigma * random.standard_normal(self.beams), math.inf)
        if self.outlier_share > 0.0:
            stray = random.random(self.beams) < self.outlier_share
            anywhere = random.uniform(self.range_min_m, self.range_max_m, self.beams)
            ranges = np.where(stray, anywhere, ranges)
        if self.dropout_share > 0.0:
            ranges[random.random(self.beams) < self.dropout_share] = math.inf
        if self.resolution_m > 0.0:
            ranges = np.round(ranges / self.resolution_m) * self.resolution_m
        ranges[ranges > self.range_max_m] = math.inf
        ranges[ranges < self.range_min_m] = -math.inf
        return ranges.astype(np.float32)


_MODELS = (
    LidarModel(  # Hokuyo UST-10LX
        name="ust10lx",
        beams=1081,
        first_deg=-135.0,
        step_deg=0.25,
        rate_hz=40.0,
        range_min_m=0.06,
        range_max_m=10.0,
        turn_s=0.025,
    ),
    LidarModel(  # Hokuyo UTM-30LX
        name="utm30lx",
        beams=1081,
        first_deg=-135.0,
        step_deg=0.25,
        rate_hz=40.0,
        range_min_m=0.1,
        range_max_m=30.0,
        turn_s=0.025,
    ),
    LidarModel(  # SICK LMS 200: a serial line of 38.4 kBd carries ten scans a second
        name="lms200",
        beams=181,
        first_deg=-90.0,
        step_deg=1.0,
        rate_hz=10.0,
        range_min_m=0.1,
        range_max_m=80.0,
        turn_s=1.0 / 75.0,
    ),
    LidarModel(  # the same, interlaced
        name="lms200half",
        beams=361,
        first_deg=-90.0,
        step_deg=0.5,
        rate_hz=5.0,
        range_min_m=0.1,
        range_max_m=80.0,
        turn_s=2.0 / 75.0,
    ),
    LidarModel(  # Hokuyo URG-04LX in poor light
        name="urg04lx",
        beams=683,
        first_deg=-341 * 360.0 / 1024.0,
        step_deg=360.0 / 1024.0,
        rate_hz=10.0,
        range_min_m=0.06,
        range_max_m=4.0,
        turn_s=0.1,
        range_sigma_share=0.01,
        outlier_share=0.05,
    ),
    LidarModel(  # a low-cost triangulation lidar that turns all the way round
        name="lowcost360",
        beams=360,
        first_deg=-180.0,
        step_deg=1.0,
        rate_hz=10.0,
        range_min_m=0.15,
        range_max_m=6.0,
        turn_s=0.1,
        range_sigma_share=0.015,
        outlier_share=0.02,
        dropout_share=0.02,
    ),
)
LIDARS = {model.name: model for model in _MODELS}
