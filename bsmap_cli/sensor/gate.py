"""Which beams of a scan are returns, and where they lie in the base frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import lean
from bsmap_cli.geometry.se2 import Points, Vector
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


@lru_cache(maxsize=64)
def _beam_table(
    first_rad: float, step_rad: float, beams: int, ignored_deg: tuple[tuple[float, float], ...]
) -> tuple[Vector, Vector, NDArray[np.bool_]]:
    """Cosine, sine and use of each beam of a scan."""
    angles = first_rad + np.arange(beams) * step_rad
    used = np.ones(beams, bool)
    for start_deg, end_deg in ignored_deg:
        width = end_deg - start_deg
        if width < 360.0:  # else all around, which the remainder would take for nothing
            width %= 360.0
        used &= (np.degrees(angles) - start_deg) % 360.0 > width
    return np.cos(angles), np.sin(angles), used


@lean
def _gather(
    ranges: Ranges,
    cosines: Vector,
    sines: Vector,
    used: NDArray[np.bool_],
    near: float,
    far: float,
    laser: Vector,
    twist: Vector,
    beam_time: float,
    points: Points,
    lengths: Vector,
    returned: NDArray[np.int64],
) -> int:
    """Write the returns in the base frame of the first ray's instant; their number."""
    cos, sin = math.cos(laser[2]), math.sin(laser[2])
    moving = beam_time != 0.0 and (twist[0] != 0.0 or twist[1] != 0.0 or twist[2] != 0.0)
    count = 0
    beams = len(ranges)
    for i in range(beams):
        r = float(ranges[i])
        if not (used[i] and near <= r <= far):
            continue
        x, y = r * cosines[i], r * sines[i]
        bx = cos * x - sin * y + laser[0]
        by = sin * x + cos * y + laser[1]
        if moving:
            elapsed = beam_time * i if beam_time > 0.0 else beam_time * (i - beams + 1)
            turn = twist[2] * elapsed
            c, s = math.cos(turn), math.sin(turn)
            bx, by = (
                c * bx - s * by + twist[0] * elapsed,
                s * bx + c * by + twist[1] * elapsed,
            )
        points[count, 0] = bx
        points[count, 1] = by
        lengths[count] = r
        returned[count] = i
        count += 1
    return count


def used_beams(scan: Scan, settings: SensorSettings) -> NDArray[np.bool_]:
    """(n,) bool: beams outside the sectors in which the robot sees itself."""
    return _beam_table(
        scan.angle_min_rad,
        scan.angle_increment_rad,
        len(scan.ranges_m),
        settings.ignore_angles_deg,
    )[2]


def range_limits(scan: Scan, settings: SensorSettings, knot_step_m: float) -> tuple[float, float]:
    """Shortest and longest range [m] that counts as a return of this scan."""
    far = scan.range_max_m * FAIR_SHARE
    if not 0.0 < far < math.inf:
        far = math.inf
    far = min(far, settings.range_max_m or FARTHEST_STEPS * knot_step_m)
    near = max(scan.range_min_m, settings.range_min_m, 1e-3 * knot_step_m)
    return near, far


def find_returns(
    scan: Scan, settings: SensorSettings, knot_step_m: float, twist_body: Vector | None = None
) -> Returns:
    """The returns; `twist_body` (vx, vy [m/s], omega [rad/s]) undoes the motion of the sweep."""
    beams = len(scan.ranges_m)
    cosines, sines, used = _beam_table(
        scan.angle_min_rad, scan.angle_increment_rad, beams, settings.ignore_angles_deg
    )
    near, far = range_limits(scan, settings, knot_step_m)
    points, lengths = np.empty((beams, 2)), np.empty(beams)
    returned = np.empty(beams, np.int64)
    deskew = twist_body is not None and settings.deskew == "auto"
    count = _gather(
        scan.ranges_m,
        cosines,
        sines,
        used,
        near,
        far,
        scan.pose_base_laser.as_array(),
        twist_body if twist_body is not None else STANDING,
        scan.time_increment_s if deskew else 0.0,
        points,
        lengths,
        returned,
    )
    points, lengths, returned = points[:count], lengths[:count], returned[:count]
    if beams * scan.angle_increment_rad > math.tau - 1.5 * scan.angle_increment_rad and count > 2:
        gaps = np.hypot(*(points - np.roll(points, 1, axis=0)).T)
        seam = int(np.argmax(gaps))
        points, lengths = np.roll(points, -seam, axis=0), np.roll(lengths, -seam)
        returned = np.concatenate((returned[seam:], returned[:seam] + beams))
    return Returns(points, lengths, returned, scan.angle_increment_rad)
