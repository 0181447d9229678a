"""Logs of text lines, a scan a line, with the pose of the robot beside it."""

from __future__ import annotations

import re
from collections.abc import Generator, Iterator, Sequence
from typing import NamedTuple, Protocol

from bsmap_cli.errors import UsageError
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.byte_streams import DamagedBytesError
from bsmap_cli.logs.drawn_log import DrawnLog
from bsmap_cli.logs.laser import scan_of
from bsmap_cli.logs.messages import SECOND_NS, BadMessageError, LaserRecord
from bsmap_cli.logs.reader import TELL_PLACE, LogInfo, ReadOptions, ReadReport, TopicInfo
from bsmap_cli.logs.sources import Source
from bsmap_cli.logs.window import ScanWindow, Verdict
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.stamps import parse_stamp

LINE_LIMIT_BYTES = 1 << 24
_LONGEST_FAULT = 120
# what int() and float() say, in words for a user
_PLAINLY = {
    re.compile(
        r"invalid literal for int\(\) with base 10: b?('.*')", re.S
    ): r"\1 is no whole number",
    re.compile(r"could not convert string to float: b?('.*')", re.S): r"\1 is no number",
}


class TextScan(NamedTuple):
    """One line that holds a scan; `pose_base_laser` is None where the log does not tell it.

    place : which line of which file, where the parser tells it.
    """

    topic: str
    record: LaserRecord
    pose_odom_base: SE2 | None
    pose_base_laser: SE2 | None
    place: str = ""


class TextParser(Protocol):
    """One format of text lines."""

    format: str

    def scans(self, report: ReadReport) -> Iterator[TextScan | BadMessageError]:
        """The scans of all sources in the order of the lines; what is wrong with bad lines."""
        ...

    def other_lines(self) -> dict[str, int]:
        """How many lines of other known kinds were passed over, by kind."""
        ...


class TextLog(DrawnLog):
    """Streams the scans of a parser; see `LogReader`."""

    def __init__(
        self, name: str, sources: Sequence[Source], parser: TextParser, options: ReadOptions
    ) -> None:
        super().__init__(name, sources, options)
        if options.odom not in ("auto", "none"):
            raise UsageError(
                f"{name} is a {parser.format} log, its poses stand beside its scans:"
                " --odom is auto or none"
            )
        self._parser = parser

    def _draw(self) -> Generator[Scan, None, None]:
        window = ScanWindow(self._options)
        for line in self._parser.scans(self.report):
            if isinstance(line, BadMessageError):
                self._skip(line)
                continue
            verdict = window.judge(line.record.stamp_ns, line.topic)
            if verdict is Verdict.STOP:
                return
            if verdict is Verdict.SKIP:
                continue
            try:
                scan = self._scan(line)
            except BadMessageError as error:
                self._skip(BadMessageError(f"{line.place}: {error}") if line.place else error)
                continue
            self.report.scans_read += 1
            yield scan

    def info(self) -> LogInfo:
        """See `LogReader.info`; the log is read through."""
        counts: dict[str, int] = {}
        beams, low_ns, high_ns, odometry = 0, 0, 0, "none"
        for line in self._parser.scans(self.report):
            if isinstance(line, BadMessageError):
                self._skip(line)
                continue
            stamp_ns = line.record.stamp_ns
            low_ns, high_ns = (
                (min(low_ns, stamp_ns), max(high_ns, stamp_ns))
                if counts
                else (
                    stamp_ns,
                    stamp_ns,
                )
            )
            counts[line.topic] = counts.get(line.topic, 0) + 1
            beams = beams or len(line.record.ranges_m)
            if line.pose_odom_base is not None and self._options.odom != "none":
                odometry = _POSES
        duration_s = (high_ns - low_ns) / SECOND_NS
        topics = [(topic, count, True) for topic, count in counts.items()]
        topics += [(kind, count, False) for kind, count in self._parser.other_lines().items()]
        return LogInfo(
            format=self._parser.format,
            duration_s=duration_s,
            topics=tuple(
                TopicInfo(
                    topic=topic,
                    type=f"{self._parser.format} {'scan' if usable else 'line'}",
                    messages=count,
                    rate_hz=(count - 1) / duration_s if duration_s > 0.0 and count > 1 else 0.0,
                    frame="",
                    usable=usable,
                )
                for topic, count, usable in sorted(topics)
            ),
            selected=tuple(sorted(counts)),
            beams=beams,
            odometry=odometry,
        )

    def _scan(self, line: TextScan) -> Scan:
        options = self._options
        pose_base_laser = options.pose_base_laser or line.pose_base_laser
        if pose_base_laser is None:
            self.report.places_unknown = True
            self.report.warn(
                "the log does not tell where the laser sits: it is taken to be the base"
                + TELL_PLACE,
                finding="mounting",
            )
            pose_base_laser = SE2.identity()
        pose_odom_base = line.pose_odom_base if options.odom == "auto" else None
        if pose_odom_base is not None:
            self.report.odometry = _POSES
        return scan_of(
            line.record,
            stamp_ns=line.record.stamp_ns,
            topic=line.topic,
            pose_base_laser=pose_base_laser,
            upside_down=options.laser_flipped,
            pose_odom_base=pose_odom_base,
        )

    def _skip(self, error: BadMessageError) -> None:
        self.report.skip_scan(str(error))
        if self.report.scans_skipped == 1:
            self.report.warn(f"lines of {self._name} are skipped, the first because: {error}")


_POSES = "poses in the log"


def bad_line(number: int, source: Source, error: Exception) -> BadMessageError:
    """What is wrong with a line, in few words however long the line is."""
    what = str(error)
    for pattern, plain in _PLAINLY.items():
        what = pattern.sub(plain, what)
    if len(what) > _LONGEST_FAULT:
        what = what[:_LONGEST_FAULT] + " ..."
    return BadMessageError(f"{place_of(number, source)}: {what}")


def place_of(number: int, source: Source) -> str:
    """A line, as a user is told of it."""
    return f"line {number} of {source.name}"


def lines_of(source: Source, report: ReadReport) -> Iterator[tuple[int, bytes]]:
    """Line number and line, with its end; damage and a cut last line are told to `report`."""
    number = 0
    with source.open() as stream:
        try:
            while line := stream.readline(LINE_LIMIT_BYTES):
                number += 1
                yield number, line
                while len(line) == LINE_LIMIT_BYTES and not line.endswith(b"\n"):
                    line = stream.readline(LINE_LIMIT_BYTES)  # the rest of an endless line
        except DamagedBytesError as error:
            report.lose(f"{source.name}: {error}; what comes before is used")


def stamp_ns_of(text: bytes) -> int:
    """Decimal seconds to nanoseconds, exactly; raises BadMessageError for other text."""
    whole, _, fraction = text.partition(b".")
    if whole.isdigit() and fraction.isdigit() and len(whole) <= 10 and len(fraction) <= 9:
        return int(whole) * SECOND_NS + int(fraction.ljust(9, b"0"))
    try:
        return parse_stamp(text.decode("ascii"))
    except ValueError as error:
        raise BadMessageError("a stamp that is no number of seconds") from error
