"""From a message's numbers to a `Scan`: counter-clockwise, upright, in float32."""

from __future__ import annotations

import math

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import float32_value
from bsmap_cli.logs.messages import BadMessageError, LaserRecord
from bsmap_cli.sensor.scan import Scan

_TURN_LIMIT_RAD = 1.05 * math.tau
_STAMP_LIMIT_NS = 2**63
_STEP_LIMIT_RAD = math.radians(10.0)


def scan_of(
    record: LaserRecord,
    *,
    stamp_ns: int,
    topic: str,
    pose_base_laser: SE2,
    upside_down: bool,
    pose_odom_base: SE2 | None,
) -> Scan:
    """The scan of a record.

    upside_down : the laser hangs from its base; `pose_base_laser` then is the place and heading
        of its x axis, and left and right are exchanged here.

    Raises BadMessageError for a scan without beams or with angles that cannot be.
    """
    ranges = record.ranges_m
    count = len(ranges)
    low, step = record.angle_min_rad, record.angle_increment_rad
    span_rad = (count - 1) * step
    if count < 2:
        raise BadMessageError("a scan without beams")
    if not (math.isfinite(low) and 0.0 < abs(step) <= _STEP_LIMIT_RAD):
        raise BadMessageError("a scan whose beam angles are no angles")
    if abs(span_rad) > _TURN_LIMIT_RAD or abs(low) > 2.0 * math.tau:
        raise BadMessageError("a scan of more than a turn")
    if abs(stamp_ns) >= _STAMP_LIMIT_NS:
        raise BadMessageError("a stamp beyond 64 bits")
    time_step = record.time_increment_s if math.isfinite(record.time_increment_s) else 0.0
    if upside_down:
        low, step = -low, -step
    if step < 0.0:
        low, step, time_step = low - abs(span_rad), -step, -time_step
        ranges = ranges[::-1].copy()
    return Scan(
        stamp_ns=stamp_ns,
        ranges_m=ranges,
        angle_min_rad=float32_value(low),
        angle_increment_rad=float32_value(step),
        range_min_m=_limit(record.range_min_m, 0.0),
        range_max_m=_limit(record.range_max_m, math.inf),
        time_increment_s=float32_value(time_step),
        pose_base_laser=pose_base_laser,
        pose_odom_base=pose_odom_base,
        topic=topic,
    )


def _limit(stated_m: float, unknown_m: float) -> float:
    """A limit as the log states it; zero, negative and NaN limits state nothing."""
    return float32_value(stated_m) if stated_m > 0.0 else unknown_m
