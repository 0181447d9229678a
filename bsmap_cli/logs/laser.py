"""From a message's numbers to a `Scan`: counter-clockwise, upright, in float32."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import float32_value
from bsmap_cli.logs.messages import BadMessageError, LaserRecord
from bsmap_cli.sensor.scan import Scan

_TURN_LIMIT_RAD = 1.05 * math.tau
STAMP_LIMIT_NS = 2**63


class _Sweep(NamedTuple):
    """What scans of one laser have in common."""

    angle_min_rad: float
    angle_increment_rad: float
    time_increment_s: float
    range_min_m: float
    range_max_m: float
    is_reversed: bool


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
    if abs(stamp_ns) >= STAMP_LIMIT_NS:
        raise BadMessageError("a stamp beyond 64 bits")
    _, _, low, step, time_step, near, far, ranges, _ = record
    sweep = _sweep((low, step, time_step, near, far), len(ranges), upside_down)
    return Scan(
        stamp_ns=stamp_ns,
        ranges_m=ranges[::-1].copy() if sweep.is_reversed else ranges,
        angle_min_rad=sweep.angle_min_rad,
        angle_increment_rad=sweep.angle_increment_rad,
        range_min_m=sweep.range_min_m,
        range_max_m=sweep.range_max_m,
        time_increment_s=sweep.time_increment_s,
        pose_base_laser=pose_base_laser,
        pose_odom_base=pose_odom_base,
        topic=topic,
    )


@lru_cache(maxsize=64)
def _sweep(
    numbers: tuple[float, float, float, float, float], count: int, upside_down: bool
) -> _Sweep:
    low, step, time_step, near, far = numbers
    span_rad = abs((count - 1) * step)
    if count < 2:
        raise BadMessageError("a scan without beams")
    if not (math.isfinite(low) and 0.0 < abs(step) <= math.pi):
        raise BadMessageError("a scan whose angle_increment is no step in radians")
    if span_rad > _TURN_LIMIT_RAD or abs(low) > 2.0 * math.tau:
        raise BadMessageError("a scan of more than a turn: its angles must be in radians")
    if not math.isfinite(time_step):
        time_step = 0.0
    if upside_down:
        low, step = -low, -step
    is_reversed = step < 0.0
    if is_reversed:
        low, step, time_step = low - span_rad, -step, -time_step
    return _Sweep(
        float32_value(low),
        float32_value(step),
        float32_value(time_step),
        float32_value(near) if near > 0.0 else 0.0,
        float32_value(far) if far > 0.0 else math.inf,
        is_reversed,
    )
