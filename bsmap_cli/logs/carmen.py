"""CARMEN logs: lines `FLASER` and `ROBOTLASER1` with the robot's pose in each, or `RAWLASER1`.

Where both are there, raw lines are the same scans once more and passed over. Raw scans take their
pose from the `ODOM` lines around them. Other lines (`PARAM`, `SYNC`, `RLASER`, ...) are passed
over, but for the one `PARAM` that tells where the laser sits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import TypeAlias

import numpy as np

from bsmap_cli.errors import LogError
from bsmap_cli.geometry.se2 import SE2, wrap_angle
from bsmap_cli.logs.canonical import canonical_pose
from bsmap_cli.logs.carmen_lines import (
    FARTHEST_LASER_M,
    FLASER,
    ODOM,
    OTHER_WORDS,
    RAWLASER,
    ROBOTLASER,
    OdomLine,
    ScanLine,
    flaser_line,
    laser_offset,
    odom_line,
    rawlaser_line,
    robotlaser_line,
)
from bsmap_cli.logs.carmen_poses import with_poses
from bsmap_cli.logs.messages import BadMessageError
from bsmap_cli.logs.reader import ReadOptions, ReadReport
from bsmap_cli.logs.sources import Source
from bsmap_cli.logs.text_log import TextScan, bad_line, lines_of
from bsmap_cli.logs.topics import choose_scan_topics

_JUDGED_SCANS, _JUDGED_LINES = 100, 20_000
_SAME_M, _SAME_RAD = 1e-3, 1e-3

_Line: TypeAlias = ScanLine | OdomLine | BadMessageError


class CarmenParser:
    """See `TextParser`."""

    format = "CARMEN"

    def __init__(self, name: str, sources: Sequence[Source], options: ReadOptions) -> None:
        self._name = name
        self._sources = sources
        self._options = options
        self._others: dict[str, int] = {}
        self._offset: SE2 | None = None

    def other_lines(self) -> dict[str, int]:
        """See `TextParser.other_lines`."""
        return self._others

    def scans(self, report: ReadReport) -> Iterator[TextScan | BadMessageError]:
        """See `TextParser.scans`; the first 100 scans decide the topic and the laser's place."""
        lines = self._lines(report)
        judged: list[_Line] = []
        scans: list[ScanLine] = []
        for line in lines:
            drives = isinstance(line, OdomLine) and not scans  # before the laser runs
            if drives and judged and isinstance(judged[-1], OdomLine):
                judged.pop()
            judged.append(line)
            if isinstance(line, ScanLine):
                scans.append(line)
            if len(scans) >= _JUDGED_SCANS or len(judged) >= _JUDGED_LINES:
                break
        if not scans:
            fault = next((line for line in judged if isinstance(line, BadMessageError)), None)
            why = f", the first because: {fault}" if fault else ""
            raise LogError(f"{self._name} holds no scan that can be read{why}")
        topics = self._topics({scan.topic for scan in scans})
        places = {topic: self._place(topic, scans) for topic in topics}
        rest: Iterator[_Line] = chain(judged, lines)
        if RAWLASER.decode() in topics:
            rest = with_poses(rest)
        for line in rest:
            if isinstance(line, BadMessageError):
                yield line
            elif isinstance(line, ScanLine) and line.topic in places:
                pose = None if line.robot is None else canonical_pose(*line.robot)
                yield TextScan(line.topic, line.record, pose, places[line.topic])

    def _topics(self, names: set[str]) -> tuple[str, ...]:
        from bsmap_cli.logs.decoding import Kind

        if len(names) > 1 and RAWLASER.decode() not in self._options.topics:
            names.discard(RAWLASER.decode())
        types = dict.fromkeys(sorted(names), "CARMEN scan")
        kinds: dict[str, Kind | None] = dict.fromkeys(types, Kind.SCAN)
        return choose_scan_topics(self._name, kinds, types, self._options.topics)

    def _place(self, topic: str, scans: list[ScanLine]) -> SE2 | None:
        if topic == RAWLASER.decode():
            return self._offset
        return _laser_place([scan for scan in scans if scan.topic == topic])

    def _lines(self, report: ReadReport) -> Iterator[_Line]:
        parsers: dict[bytes, Callable[[bytes], ScanLine]] = {
            FLASER: lambda line: flaser_line(line, self._options, report),
            ROBOTLASER: robotlaser_line,
            RAWLASER: rawlaser_line,
        }
        for source in self._sources:
            for number, line in lines_of(source, report):
                word = line.split(None, 1)[:1]
                parse = parsers.get(word[0]) if word else None
                if parse is not None:
                    try:
                        yield parse(line)
                    except (ValueError, IndexError, OverflowError, BadMessageError) as error:
                        yield bad_line(number, source, error)
                elif word and (odom := self._other(line.split())) is not None:
                    yield odom

    def _other(self, words: list[bytes]) -> OdomLine | None:
        """Count a line without a scan; what it says of the robot's pose."""
        word = words[0]
        if word == ODOM or word in OTHER_WORDS:
            kind = word.decode()
            self._others[kind] = self._others.get(kind, 0) + 1
        if self._offset is None and word == b"PARAM":
            self._offset = laser_offset(words)
        return odom_line(words) if word == ODOM else None


def _laser_place(lines: Sequence[ScanLine]) -> SE2 | None:
    """The laser on the robot, where the first lines agree on it to 1 mm."""
    places = [
        SE2.from_array(line.robot).inverse() @ SE2.from_array(line.laser)
        for line in lines
        if line.robot is not None and line.laser is not None
    ]
    if not places:
        return None
    first = places[0]
    offsets = np.array(
        [(p.x - first.x, p.y - first.y, wrap_angle(p.theta - first.theta)) for p in places]
    )
    if np.abs(offsets[:, :2]).max() > _SAME_M or np.abs(offsets[:, 2]).max() > _SAME_RAD:
        return None
    if math.hypot(first.x, first.y) > FARTHEST_LASER_M:
        return None
    mean = offsets.mean(axis=0) + first.as_array()
    return canonical_pose(*(round(float(value), 5) + 0.0 for value in mean))
