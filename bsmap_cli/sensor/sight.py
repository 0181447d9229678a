"""How far each beam of a scan went: what it proves to be empty, whatever it ended on."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import lean
from bsmap_cli.geometry.se2 import SE2, Vector
from bsmap_cli.sensor.gate import NO_RETURN_SHARE, STANDING, SensorSettings, fan_of
from bsmap_cli.sensor.scan import Ranges, Scan


@dataclass(frozen=True, slots=True)
class Sight:
    """The beams of one scan as one fan of evenly spaced rays from one point.

    laser : (3,) x, y [m] of the laser and bearing [rad] of the first beam, base frame of the
        scan's stamp; beam_step_rad : from one beam to the next.
    ranges_m : (n,) float32, where each beam ended; inf: nothing returned it; NaN says nothing.
    """

    laser: Vector
    beam_step_rad: float
    ranges_m: NDArray[np.float32]

    @property
    def reach_m(self) -> float:
        """Where the longest beam that came back ended; 0 where none did."""
        finite = self.ranges_m[np.isfinite(self.ranges_m)]
        return float(finite.max(initial=0.0))


@lean
def _tell_ends(
    ranges: Ranges, used: NDArray[np.bool_], near_m: float, far_m: float, ends: Ranges
) -> None:
    """Where each beam ended, as `Sight` tells it."""
    for i in range(len(ranges)):
        if not (used[i] and ranges[i] >= near_m):
            ends[i] = np.nan
        elif ranges[i] > far_m:
            ends[i] = np.inf
        else:
            ends[i] = ranges[i]


def find_sight(
    scan: Scan, settings: SensorSettings, knot_step_m: float, twist_body: Vector = STANDING
) -> Sight:
    """What a scan looked through; `twist_body` (vx, vy [m/s], omega [rad/s]) as in `find_returns`.

    Under a constant turn the rays of a sweep stay evenly spaced; what the laser travels during
    the sweep counts as if all rays left from its middle.
    """
    fan = fan_of(scan, settings, knot_step_m)
    beams = len(scan.ranges_m)
    ranges = np.empty(beams, np.float32)
    most = scan.range_max_m * NO_RETURN_SHARE
    far_m = most if 0.0 < most < math.inf else fan.far_m
    _tell_ends(scan.ranges_m, fan.used, fan.near_m, far_m, ranges)
    laser, step = scan.pose_base_laser, scan.angle_increment_rad
    first = scan.angle_min_rad
    beam_time = fan.beam_time_s
    if beam_time != 0.0:
        begin = 0.0 if beam_time > 0.0 else -beam_time * (beams - 1)
        middle = begin + 0.5 * beam_time * (beams - 1)
        turn = float(twist_body[2])
        way = SE2(float(twist_body[0]) * middle, float(twist_body[1]) * middle, turn * middle)
        laser = way @ laser
        first += turn * (begin - middle)
        step += turn * beam_time
    return Sight(np.array([laser.x, laser.y, laser.theta + first]), step, ranges)
