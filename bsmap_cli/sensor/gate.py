"""Which beams of a scan are returns, and where they lie in the base frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, lean
from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.sensor.scan import Ranges, Scan
from bsmap_cli.settings import setting

FARTHEST_STEPS = 300.0  # [finest knot steps]: farther away, beams lie too far apart for curves
NO_RETURN_SHARE = 0.995  # of range_max: "a hair less" is a code for no return, too
# three deviations of 1 %, as short-range lidars have: nearer the limit readings err to one side,
# as no surface beyond it answers that would err to the other, and walls bend where they leave sight
FAIR_SHARE = 0.97
STANDING = np.zeros(3)  # as a twist


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSettings:
    """Limits of the sensor, where the log does not state better ones."""

    range_min_m: float = setting(0.0, "shorter ranges are not returns", minimum=0.0)
    range_max_m: float | None = setting(
        None,
        "longer ranges are not used; null: the log's limit, and at most 300 finest knot steps",
        minimum=0.0,
    )
    range_sigma_m: float | None = setting(
        None, "deviation of the range noise; null: estimated from the first scan", minimum=1e-6
    )
    ignore_angles_deg: tuple[tuple[float, float], ...] = setting(
        (), "sectors of the laser frame, from and to, in which the robot sees itself"
    )
    deskew: str = setting(
        "auto", "undo the motion during one sweep, or leave it", choices=("auto", "off")
    )


@dataclass(frozen=True, slots=True)
class Returns:
    """The returns of one scan, counter-clockwise.

    points_body : (m, 2) float64 [m], base frame; ranges_m : (m,) [m]; beams : (m,) which beam each
    is, rising; beam_step_rad : angle from one beam to the next. On a full circle the list starts
    behind the widest gap, so that no surface is cut at the seam, and counts on beyond it.
    """

    points_body: Points
    ranges_m: Vector
    beams: NDArray[np.int64]
    beam_step_rad: float

    def __len__(self) -> int:
        return len(self.ranges_m)


class Fan(NamedTuple):
    """What scans of one lidar have in common.

    cosines, sines : (n,) of each beam in the laser frame; used : (n,) bool, outside the sectors in
    which the robot sees itself. near_m, far_m : which ranges are returns. laser : (3,) x, y [m],
    theta [rad] of the laser in the base frame. beam_step_rad, beam_time_s : from one beam to the
    next, a time of 0 where motion is not undone. around : the beams fill a circle.
    """

    cosines: Vector
    sines: Vector
    used: NDArray[np.bool_]
    near_m: float
    far_m: float
    laser: Vector
    beam_step_rad: float
    beam_time_s: float
    around: bool


def fan_of(scan: Scan, settings: SensorSettings, knot_step_m: float) -> Fan:
    """The fan of a scan: mostly that of the scan before."""
    near, far = range_limits(scan, settings, knot_step_m)
    return _fan(
        scan.angle_min_rad,
        scan.angle_increment_rad,
        len(scan.ranges_m),
        near,
        far,
        scan.pose_base_laser,
        scan.time_increment_s if settings.deskew == "auto" else 0.0,
        settings.ignore_angles_deg,
    )


@lru_cache(maxsize=64)
def _fan(
    first_rad: float,
    step_rad: float,
    beams: int,
    near_m: float,
    far_m: float,
    pose_base_laser: SE2,
    beam_time_s: float,
    ignored_deg: tuple[tuple[float, float], ...],
) -> Fan:
    angles = first_rad + np.arange(beams) * step_rad
    used = np.ones(beams, bool)
    for start_deg, end_deg in ignored_deg:
        width = end_deg - start_deg
        if width < 360.0:  # else all around, which the remainder would take for nothing
            width %= 360.0
        used &= (np.degrees(angles) - start_deg) % 360.0 > width
    return Fan(
        np.cos(angles),
        np.sin(angles),
        used,
        near_m,
        far_m,
        pose_base_laser.as_array(),
        step_rad,
        beam_time_s,
        beams * step_rad > math.tau - 1.5 * step_rad,
    )


@inlined
def _reverse(
    points: Points, lengths: Vector, returned: NDArray[np.int64], begin: int, end: int
) -> None:
    while begin < end - 1:
        end -= 1
        for k in range(2):
            points[begin, k], points[end, k] = points[end, k], points[begin, k]
        lengths[begin], lengths[end] = lengths[end], lengths[begin]
        returned[begin], returned[end] = returned[end], returned[begin]
        begin += 1


@inlined
def _behind_widest_gap(points: Points, count: int) -> int:
    widest = -1.0
    seam = 0
    for i in range(count):
        dx, dy = points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1]
        if i == 0:
            dx, dy = points[0, 0] - points[count - 1, 0], points[0, 1] - points[count - 1, 1]
        if dx * dx + dy * dy > widest:
            widest = dx * dx + dy * dy
            seam = i
    return seam


@lean
def gather(
    ranges: Ranges,
    fan: Fan,
    twist: Vector,
    points: Points,
    lengths: Vector,
    returned: NDArray[np.int64],
) -> int:
    """Write the returns in the base frame of the first ray's instant, as `Returns`; their number.

    twist : (3,) vx, vy [m/s], omega [rad/s] of the base during the sweep.
    """
    cos, sin = math.cos(fan.laser[2]), math.sin(fan.laser[2])
    beam_time = fan.beam_time_s
    moving = beam_time != 0.0 and (twist[0] != 0.0 or twist[1] != 0.0 or twist[2] != 0.0)
    count = 0
    beams = len(ranges)
    first = 0.0 if beam_time > 0.0 else beam_time * (1 - beams)
    # the turn of each beam from that of the beam before it: a sine costs as much as all the rest
    c, s = math.cos(twist[2] * first), math.sin(twist[2] * first)
    step_c, step_s = math.cos(twist[2] * beam_time), math.sin(twist[2] * beam_time)
    for i in range(beams):
        r = float(ranges[i])
        if fan.used[i] and fan.near_m <= r <= fan.far_m:
            x, y = r * fan.cosines[i], r * fan.sines[i]
            bx = cos * x - sin * y + fan.laser[0]
            by = sin * x + cos * y + fan.laser[1]
            if moving:
                elapsed = first + beam_time * i
                bx, by = (
                    c * bx - s * by + twist[0] * elapsed,
                    s * bx + c * by + twist[1] * elapsed,
                )
            points[count, 0] = bx
            points[count, 1] = by
            lengths[count] = r
            returned[count] = i
            count += 1
        if moving:
            c, s = c * step_c - s * step_s, s * step_c + c * step_s
    if fan.around and count > 2:
        seam = _behind_widest_gap(points, count)
        for i in range(seam):
            returned[i] += beams
        _reverse(points, lengths, returned, 0, seam)
        _reverse(points, lengths, returned, seam, count)
        _reverse(points, lengths, returned, 0, count)
    return count


def range_limits(scan: Scan, settings: SensorSettings, knot_step_m: float) -> tuple[float, float]:
    """Shortest and longest range [m] that counts as a return of this scan."""
    far = scan.range_max_m * FAIR_SHARE
    if not 0.0 < far < math.inf:
        far = math.inf
    far = min(far, settings.range_max_m or FARTHEST_STEPS * knot_step_m)
    near = max(scan.range_min_m, settings.range_min_m, 1e-3 * knot_step_m)
    return near, far


def find_returns(
    scan: Scan, settings: SensorSettings, knot_step_m: float, twist_body: Vector = STANDING
) -> Returns:
    """The returns; `twist_body` (vx, vy [m/s], omega [rad/s]) undoes the motion of the sweep."""
    beams = len(scan.ranges_m)
    points, lengths = np.empty((beams, 2)), np.empty(beams)
    returned = np.empty(beams, np.int64)
    fan = fan_of(scan, settings, knot_step_m)
    count = gather(scan.ranges_m, fan, twist_body, points, lengths, returned)
    return Returns(points[:count], lengths[:count], returned[:count], fan.beam_step_rad)
