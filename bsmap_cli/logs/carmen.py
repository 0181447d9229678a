"""CARMEN logs: lines `FLASER` and `ROBOTLASER1`, with the robot's pose in each.

Other lines (`ODOM`, `PARAM`, `SYNC`, `RLASER`, ...) are passed over: the pose that belongs to a
scan stands in its own line.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from bsmap_cli.errors import LogError
from bsmap_cli.geometry.se2 import SE2, wrap_angle
from bsmap_cli.logs.canonical import canonical_pose, float32_ranges
from bsmap_cli.logs.messages import BadMessageError, LaserRecord
from bsmap_cli.logs.reader import ReadOptions, ReadReport
from bsmap_cli.logs.sources import Source
from bsmap_cli.logs.text_log import TextScan, bad_line, lines_of, stamp_ns_of
from bsmap_cli.logs.topics import choose_scan_topics

FLASER, ROBOTLASER = b"FLASER", b"ROBOTLASER1"
OTHER_WORDS = frozenset(
    (b"ODOM", b"PARAM", b"SYNC", b"NEFF", b"MARKER", b"RLASER", b"TRUEPOS", b"ROBOTLASER2")
)
_JUDGED_LINES = 100
_SAME_M, _SAME_RAD = 1e-3, 1e-3
_FARTHEST_LASER_M = 2.0
_TAIL = 3  # ipc_stamp, host, logger_stamp
_USUAL_DEG = {180: (-90.0, 1.0), 181: (-90.0, 1.0), 360: (-90.0, 0.5), 361: (-90.0, 0.5)}
"""First beam and step by the number of beams; of these there is no doubt."""

_LIKELY_DEG = {540: (-135.0, 0.5), 541: (-135.0, 0.5), 1080: (-135.0, 0.25), 1081: (-135.0, 0.25)}


class _Line(NamedTuple):
    """A parsed line; poses are x, y [m], theta [rad] in the odometry frame."""

    topic: str
    record: LaserRecord
    laser: tuple[float, float, float]
    robot: tuple[float, float, float]


class CarmenParser:
    """See `TextParser`."""

    format = "CARMEN"

    def __init__(self, name: str, sources: Sequence[Source], options: ReadOptions) -> None:
        self._name = name
        self._sources = sources
        self._options = options
        self._others: dict[str, int] = {}

    def other_lines(self) -> dict[str, int]:
        """See `TextParser.other_lines`."""
        return self._others

    def scans(self, report: ReadReport) -> Iterator[TextScan | BadMessageError]:
        """See `TextParser.scans`; the first 100 scans decide the topic and the laser's place."""
        lines = self._lines(report)
        judged: list[_Line | BadMessageError] = []
        good = 0
        for line in lines:
            judged.append(line)
            good += isinstance(line, _Line)
            if good >= _JUDGED_LINES:
                break
        topics = self._topics([line.topic for line in judged if isinstance(line, _Line)])
        places = {
            topic: _laser_place(
                [line for line in judged if isinstance(line, _Line) and line.topic == topic]
            )
            for topic in topics
        }
        for line in chain(judged, lines):
            if isinstance(line, BadMessageError):
                yield line
            elif line.topic in places:
                yield TextScan(
                    line.topic, line.record, canonical_pose(*line.robot), places[line.topic]
                )

    def _topics(self, seen: list[str]) -> tuple[str, ...]:
        from bsmap_cli.logs.decoding import Kind

        if not seen:
            raise LogError(f"{self._name} holds no scan that can be read")
        types = dict.fromkeys(sorted(set(seen)), "CARMEN scan")
        kinds: dict[str, Kind | None] = dict.fromkeys(types, Kind.SCAN)
        return choose_scan_topics(self._name, kinds, types, self._options.topics)

    def _lines(self, report: ReadReport) -> Iterator[_Line | BadMessageError]:
        parsers: dict[bytes, Callable[[list[bytes]], _Line]] = {
            FLASER: lambda words: self._flaser(words, report),
            ROBOTLASER: _robotlaser,
        }
        for source in self._sources:
            for number, line in lines_of(source, report):
                words = line.split()
                parse = parsers.get(words[0]) if words else None
                if parse is None:
                    if words and words[0] in OTHER_WORDS:
                        kind = words[0].decode()
                        self._others[kind] = self._others.get(kind, 0) + 1
                    continue
                try:
                    yield parse(words)
                except (ValueError, IndexError, BadMessageError) as error:
                    yield bad_line(number, source, error)

    def _flaser(self, words: list[bytes], report: ReadReport) -> _Line:
        count = int(words[1])
        if count < 2 or len(words) < 2 + count + 6 + _TAIL:
            raise BadMessageError("it has fewer numbers than it claims")
        low, step = self._angles(count, report)
        numbers = list(map(float, words[2 : 2 + count + 6]))
        record = _record(words[2 + count + 6], low, step, 0.0, numbers[:count])
        return _line("FLASER", record, numbers[count:])

    def _angles(self, count: int, report: ReadReport) -> tuple[float, float]:
        """No angle stands in a FLASER line: the count tells, or the user."""
        options = self._options
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


def _robotlaser(words: list[bytes]) -> _Line:
    count = int(words[8])
    remissions_at = 9 + count
    if count < 2 or len(words) <= remissions_at:
        raise BadMessageError("it has fewer numbers than it claims")
    poses_at = remissions_at + 1 + int(words[remissions_at])
    stamp_at = poses_at + 11
    if poses_at <= remissions_at or len(words) < stamp_at + _TAIL:
        raise BadMessageError("it has fewer numbers than it claims")
    low, span, step, farthest = map(float, words[2:6])
    if step == 0.0:
        step = span / (count - 1)
    record = _record(words[stamp_at], low, step, farthest, list(map(float, words[9 : 9 + count])))
    return _line("ROBOTLASER1", record, list(map(float, words[poses_at : poses_at + 6])))


def _record(
    stamp: bytes, low: float, step: float, farthest: float, ranges: list[float]
) -> LaserRecord:
    return LaserRecord(
        stamp_ns_of(stamp),
        "",
        low,
        step,
        0.0,
        0.0,
        farthest,
        float32_ranges(ranges),
    )


def _line(topic: str, record: LaserRecord, poses: list[float]) -> _Line:
    if not all(map(math.isfinite, poses)):
        raise BadMessageError("its poses are no numbers")
    lx, ly, lt, rx, ry, rt = poses
    return _Line(topic, record, (lx, ly, lt), (rx, ry, rt))


def _laser_place(lines: Sequence[_Line]) -> SE2 | None:
    """The laser on the robot, where the first lines agree on it to 1 mm."""
    if not lines:
        return None
    places = [SE2.from_array(line.robot).inverse() @ SE2.from_array(line.laser) for line in lines]
    first = places[0]
    offsets = np.array(
        [(p.x - first.x, p.y - first.y, wrap_angle(p.theta - first.theta)) for p in places]
    )
    if np.abs(offsets[:, :2]).max() > _SAME_M or np.abs(offsets[:, 2]).max() > _SAME_RAD:
        return None
    if math.hypot(first.x, first.y) > _FARTHEST_LASER_M:
        return None
    mean = offsets.mean(axis=0) + first.as_array()
    return canonical_pose(*(round(float(value), 5) + 0.0 for value in mean))
