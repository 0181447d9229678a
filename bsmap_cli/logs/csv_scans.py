"""CSV, our own plain form: a header row, then a scan a row.

Columns by name, in any order: `stamp_ns` or `t` [s]; `r0,r1,...` [m]. Optional: `x,y,theta`
(odometry), `angle_min,angle_increment` [rad] (else from the command line),
`range_min,range_max`, `time_increment`, `laser_x,laser_y,laser_theta` (the laser on the base).

The header tells the separator: a comma, or a semicolon or tab as spreadsheets write them where
the decimal point is a comma.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from bsmap_cli.errors import LogError, UsageError
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import canonical_pose, float32_ranges
from bsmap_cli.logs.messages import BadMessageError, LaserRecord
from bsmap_cli.logs.plain_numbers import plain_numbers
from bsmap_cli.logs.reader import ReadOptions, ReadReport
from bsmap_cli.logs.sources import Source
from bsmap_cli.logs.text_log import TextScan, bad_line, lines_of, place_of, stamp_ns_of

TOPIC = "csv"
BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_RANGE = re.compile(r"r(\d{1,7})")
_STAMP_LIMIT = 2**63
_SEPARATORS = (b",", b";", b"\t")
_QUOTED = re.compile(rb'"([^"]*)"')


@dataclass(frozen=True, slots=True)
class _Header:
    """Where the columns are; `ranges` in beam order, `ranges_last` where they end the row."""

    columns: dict[str, int]
    ranges: tuple[int, ...]
    ranges_last: bool
    separator: bytes


class CsvParser:
    """See `TextParser`."""

    format = "CSV"

    def __init__(self, name: str, sources: Sequence[Source], options: ReadOptions) -> None:
        if options.topics and options.topics != (TOPIC,):
            raise UsageError(f"{name} is a CSV log, it has no topics: leave out --topic")
        self._name = name
        self._sources = sources
        self._options = options

    def other_lines(self) -> dict[str, int]:
        """See `TextParser.other_lines`: there are none."""
        return {}

    def scans(self, report: ReadReport) -> Iterator[TextScan | BadMessageError]:
        """See `TextParser.scans`; every part has a header row of its own."""
        for source in self._sources:
            header: _Header | None = None
            for number, line in lines_of(source, report):
                text = _text(line)
                if not text:
                    continue
                if header is None:
                    header = self._header(text, source.name)
                    continue
                try:
                    scan = self._scan(text, header, is_whole=line.endswith(b"\n"))
                    yield scan._replace(place=place_of(number, source))
                except (ValueError, OverflowError, BadMessageError) as error:
                    yield bad_line(number, source, error)

    def _header(self, text: bytes, source: str) -> _Header:
        separator = _separator_of(text) or b","
        names = _names(text, separator)
        columns = {name: index for index, name in enumerate(names)}
        if "stamp_ns" not in columns and "t" not in columns:
            raise LogError(f"{source} has no column stamp_ns or t: a scan needs a stamp")
        beams = sorted(
            (int(match[1]), index)
            for index, name in enumerate(names)
            if (match := _RANGE.fullmatch(name))
        )
        ranges = tuple(index for _, index in beams)
        if [beam for beam, _ in beams] != list(range(len(beams))) or len(beams) < 2:
            raise LogError(f"{source} has no columns r0, r1, ... without a hole: a scan needs them")
        options = self._options
        for column, flag, given in (
            ("angle_min", "--angle-min", options.angle_min_rad),
            ("angle_increment", "--angle-increment", options.angle_increment_rad),
        ):
            if column not in columns and given is None:
                raise UsageError(f"{source} has no column {column}: give {flag}")
        ranges_last = ranges == tuple(range(len(names) - len(ranges), len(names)))
        return _Header(columns, ranges, ranges_last, separator)

    def _scan(self, text: bytes, header: _Header, *, is_whole: bool) -> TextScan:
        cells, ranges_m = _row(text, header)
        width = len(cells) + (len(ranges_m) if header.ranges_last else 0)
        if not is_whole and width < len(header.columns):
            raise BadMessageError("the last line is cut off")
        fields = _Fields(cells, header.columns)
        options = self._options
        record = LaserRecord(
            fields.stamp_ns(),
            "",
            fields.number("angle_min", options.angle_min_rad),
            fields.number("angle_increment", options.angle_increment_rad),
            fields.number("time_increment", 0.0),
            fields.number("range_min", 0.0),
            fields.number("range_max", math.inf),
            float32_ranges(ranges_m),
        )
        return TextScan(
            TOPIC,
            record,
            fields.pose("x", "y", "theta"),
            fields.pose("laser_x", "laser_y", "laser_theta"),
        )


@dataclass(frozen=True, slots=True)
class _Fields:
    """The cells of one row by the names of their columns."""

    cells: list[bytes]
    columns: dict[str, int]

    def stamp_ns(self) -> int:
        if "stamp_ns" not in self.columns:
            return stamp_ns_of(self._cell("t"))
        stamp_ns = int(self._cell("stamp_ns"))
        if abs(stamp_ns) >= _STAMP_LIMIT:
            raise BadMessageError("a stamp beyond 64 bits")
        return stamp_ns

    def number(self, name: str, otherwise: float | None) -> float:
        text = self._cell(name)
        if text:
            return float(text)
        return math.nan if otherwise is None else otherwise

    def pose(self, x: str, y: str, theta: str) -> SE2 | None:
        numbers = [self.number(name, None) for name in (x, y, theta)]
        return canonical_pose(*numbers) if all(map(math.isfinite, numbers)) else None

    def _cell(self, name: str) -> bytes:
        index = self.columns.get(name, len(self.cells))
        return self.cells[index] if index < len(self.cells) else b""


def _text(line: bytes) -> bytes:
    """What a line says: nothing for an empty one or a comment."""
    text = line.partition(b"#")[0].strip(b" \r\n").removeprefix(BYTE_ORDER_MARK)
    if b'"' in text:  # a comma in quotes is a decimal point
        text = _QUOTED.sub(lambda cell: cell[1].replace(b",", b"."), text)
    return text if text.strip() else b""


def _row(text: bytes, header: _Header) -> tuple[list[bytes], list[float]]:
    """The cells of a row, without those of ranges where these end it, and the ranges."""
    separator, first = header.separator, header.ranges[0]
    if separator != b",":  # a comma that separates nothing is a decimal point
        text = text.replace(b",", b".")
    if header.ranges_last:
        *cells, rest = text.split(separator, first)
        numbers = plain_numbers(rest, separator) if len(cells) == first else None
        if numbers is not None:
            return cells, numbers
    cells = text.split(separator)
    texts = [cells[index] for index in header.ranges if index < len(cells)]
    others = cells[:first] if header.ranges_last else cells
    return others, [float(text) if text.strip() else math.nan for text in texts]


def _names(text: bytes, separator: bytes) -> list[str]:
    cells = text.split(separator)
    return [cell.strip().decode("utf-8", "replace").lower() for cell in cells]


def is_header(line: bytes) -> bool:
    """Whether a line of text names the columns of a log of scans."""
    return _separator_of(_text(line)) is not None


def _separator_of(text: bytes) -> bytes | None:
    """What separates the names of columns; None where these are none of a log of scans."""
    for separator in _SEPARATORS:
        names = _names(text, separator)
        if len(names) > 2 and any(
            name in ("t", "stamp_ns") or _RANGE.fullmatch(name) for name in names
        ):
            return separator
    return None
