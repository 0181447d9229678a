"""Lines of CARMEN logs: `FLASER`, `ROBOTLASER1`, `RAWLASER1`, `ODOM` and the laser's `PARAM`.

http://carmen.sourceforge.net/logger_playback.html
"""

from __future__ import annotations

import math
from typing import NamedTuple

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import float32_ranges
from bsmap_cli.logs.messages import BadMessageError, LaserRecord
from bsmap_cli.logs.plain_numbers import plain_numbers
from bsmap_cli.logs.reader import ReadOptions, ReadReport
from bsmap_cli.logs.text_log import stamp_ns_of

FLASER, ROBOTLASER, RAWLASER, ODOM = b"FLASER", b"ROBOTLASER1", b"RAWLASER1", b"ODOM"
OTHER_WORDS = frozenset(
    (b"PARAM", b"SYNC", b"NEFF", b"MARKER", b"RLASER", b"TRUEPOS", b"ROBOTLASER2", b"RAWLASER2")
)
ALL_WORDS = OTHER_WORDS | {FLASER, ROBOTLASER, RAWLASER, ODOM}
FARTHEST_LASER_M = 2.0
_OFFSET = b"robot_frontlaser_offset"
_TAIL = 3  # ipc_stamp, host, logger_stamp
_USUAL_DEG = {180: (-90.0, 1.0), 181: (-90.0, 1.0), 360: (-90.0, 0.5), 361: (-90.0, 0.5)}
"""First beam and step by the number of beams; of these there is no doubt."""

_LIKELY_DEG = {540: (-135.0, 0.5), 541: (-135.0, 0.5), 1080: (-135.0, 0.25), 1081: (-135.0, 0.25)}

Pose = tuple[float, float, float]


class ScanLine(NamedTuple):
    """A scan; poses of laser and robot are x, y [m], theta [rad] in the odometry frame.

    A raw line has no poses: they stand in lines of their own.
    """

    topic: str
    record: LaserRecord
    laser: Pose | None
    robot: Pose | None


class OdomLine(NamedTuple):
    """The pose of the robot at a stamp."""

    stamp_ns: int
    robot: Pose


def flaser_line(line: bytes, options: ReadOptions, report: ReadReport) -> ScanLine:
    """`FLASER n r1..rn x y theta odom_x odom_y odom_theta ipc_stamp host logger_stamp`."""
    numbers, stamp = _flaser_numbers(line)
    count = len(numbers) - 6
    low, step = _angles(count, options, report)
    record = _record(stamp, low, step, 0.0, numbers[:count])
    return _posed("FLASER", record, list(map(float, numbers[count:])))


def _flaser_numbers(line: bytes) -> tuple[list[float], bytes]:
    """The n + 6 numbers, and the stamp."""
    head, _, rest = line.strip().partition(b" ")[2].partition(b" ")
    tail = rest.rsplit(None, _TAIL)
    numbers = plain_numbers(tail[0]) if len(tail) == _TAIL + 1 else None
    if numbers is not None and head.isdigit() and len(numbers) == int(head) + 6 >= 8:
        return numbers, tail[1]
    words = line.split()  # more behind the stamp, or fewer numbers, or spelt in another way
    count = int(words[1])
    if count < 2 or len(words) < 2 + count + 6 + _TAIL:
        raise BadMessageError("it has fewer numbers than it claims")
    return list(map(float, words[2 : 2 + count + 6])), words[2 + count + 6]


def robotlaser_line(line: bytes) -> ScanLine:
    """`ROBOTLASER1`: a raw line with laser pose, robot pose and five numbers before its stamp."""
    words = line.split()
    record, poses_at = _self_described(words, gap=11)
    return _posed("ROBOTLASER1", record, list(map(float, words[poses_at : poses_at + 6])))


def rawlaser_line(line: bytes) -> ScanLine:
    """`RAWLASER1 type start fov step maxrange accuracy mode n r.. m rem.. ipc_stamp host ...`."""
    record, _ = _self_described(line.split(), gap=0)
    return ScanLine("RAWLASER1", record, None, None)


def odom_line(words: list[bytes]) -> OdomLine | None:
    """`ODOM x y theta tv rv accel ipc_stamp host logger_stamp`; None where it is none."""
    try:
        x, y, theta = map(float, words[1:4])
        stamp_ns = stamp_ns_of(words[-_TAIL])
    except (ValueError, IndexError, BadMessageError):
        return None
    return OdomLine(stamp_ns, (x, y, theta)) if _are_numbers((x, y, theta)) else None


def laser_offset(words: list[bytes]) -> SE2 | None:
    """The laser ahead of the robot's centre, where a `PARAM` line tells it."""
    if len(words) < 3 or words[1] != _OFFSET:
        return None
    try:
        offset_m = float(words[2])
    except ValueError:
        return None
    return SE2(offset_m, 0.0, 0.0) if abs(offset_m) <= FARTHEST_LASER_M else None


def _self_described(words: list[bytes], *, gap: int) -> tuple[LaserRecord, int]:
    """A line with its angles; the place behind the remissions, `gap` words before the stamp."""
    count = int(words[8])
    remissions_at = 9 + count
    if count < 2 or len(words) <= remissions_at:
        raise BadMessageError("it has fewer numbers than it claims")
    end = remissions_at + 1 + int(words[remissions_at])
    if end <= remissions_at or len(words) < end + gap + _TAIL:
        raise BadMessageError("it has fewer numbers than it claims")
    low, span, step, farthest = map(float, words[2:6])
    if step == 0.0:
        step = span / (count - 1)
    ranges = list(map(float, words[9 : 9 + count]))
    return _record(words[end + gap], low, step, farthest, ranges), end


def _angles(count: int, options: ReadOptions, report: ReadReport) -> tuple[float, float]:
    """No angle stands in a FLASER line: the count tells, or the user."""
    is_told = options.angle_min_rad is not None and options.angle_increment_rad is not None
    angles_deg = _USUAL_DEG.get(count)
    if angles_deg is None:
        angles_deg = _LIKELY_DEG.get(count, (-90.0, 180.0 / (count - count % 2)))
        if not is_told:
            report.warn(
                f"FLASER lines of {count} beams: they are taken to see {-2 * angles_deg[0]:.0f}"
                " degrees (else give --angle-min and --angle-increment)"
            )
    low, step = map(math.radians, angles_deg)
    return (
        low if options.angle_min_rad is None else options.angle_min_rad,
        step if options.angle_increment_rad is None else options.angle_increment_rad,
    )


def _record(
    stamp: bytes, low: float, step: float, farthest: float, ranges: list[float]
) -> LaserRecord:
    ranges_m = float32_ranges(ranges)
    return LaserRecord(stamp_ns_of(stamp), "", low, step, 0.0, 0.0, farthest, ranges_m)


def _posed(topic: str, record: LaserRecord, poses: list[float]) -> ScanLine:
    if not _are_numbers(poses):
        raise BadMessageError("its poses are no numbers")
    lx, ly, lt, rx, ry, rt = poses
    return ScanLine(topic, record, (lx, ly, lt), (rx, ry, rt))


def _are_numbers(values: list[float] | Pose) -> bool:
    return all(map(math.isfinite, values))
