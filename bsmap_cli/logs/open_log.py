"""Open any log: the content decides the format, not the suffix."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import BinaryIO

from bsmap_cli.errors import LogError
from bsmap_cli.logs import carmen_lines, csv_scans, mcap_records, rosbag1_records, sqlite_container
from bsmap_cli.logs.byte_streams import DamagedBytesError, put_back, read_up_to
from bsmap_cli.logs.carmen import CarmenParser
from bsmap_cli.logs.csv_scans import CsvParser
from bsmap_cli.logs.mcap_container import McapContainer
from bsmap_cli.logs.message_log import MessageLog
from bsmap_cli.logs.messages import Container
from bsmap_cli.logs.reader import LogReader, ReadOptions
from bsmap_cli.logs.rosbag1_container import Rosbag1Container
from bsmap_cli.logs.sources import Source, expand
from bsmap_cli.logs.sqlite_container import SqliteContainer
from bsmap_cli.logs.text_log import TextLog

_SNIFFED_BYTES = 16
_SNIFFED_TEXT_BYTES = 1 << 20
_KNOWN = (
    "MCAP, ROS 1 bags, ROS 2 bags, CARMEN, and CSV with a header row of t or stamp_ns and"
    " r0,r1,... are known"
)
_NO_LOGS = {
    b"\x89BSM": "a map and no log: `bsmap stats` tells what it holds",
    b"\xff\xfe": "text in UTF-16: save it as UTF-8",
    b"\xfe\xff": "text in UTF-16: save it as UTF-8",
    b"PK\x03\x04": "a zip archive: unpack it first",
    b"BZh": "packed with bzip2: unpack it first",
    b"\xfd7zXZ\0": "packed with xz: unpack it first",
}


def open_log(sources: Sequence[str | Path | BinaryIO], options: ReadOptions) -> LogReader:
    """A reader of one run: one file, several files or folders of parts, or a stream.

    sources : paths, "-" for standard input, or a binary stream that need not seek; `.gz` and
        `.zst` are unpacked on the way. Parts are read in natural order (`part_2` before
        `part_10`).

    Raises LogError for what is not there, is empty, or is no log; UsageError for options that do
    not go with the format. Nothing but the beginnings is read before `scans` or `info`.
    """
    named = expand(sources)
    try:
        reader = _reader([str(source) for source in sources], named, options)
        for missing in dict.fromkeys(part for source in named for part in source.lacks):
            reader.report.lose(f"{missing} is missing from its folder; the other parts are used")
        return reader
    except BaseException:
        for source in named:
            source.close()
        raise


def _reader(names: list[str], sources: list[Source], options: ReadOptions) -> LogReader:
    known = [(source, kind) for source in sources if (kind := _kind_of(source))]
    if not known:
        raise LogError(f"{', '.join(names)} holds no log: {_KNOWN}")
    parts = [source for source, _ in known]
    first = Path(names[0])
    named = first.name or first.resolve().name
    name = parts[0].name if len(parts) == 1 else f"{named} ({len(parts)} files)"
    kinds = {kind for _, kind in known}
    if kinds <= set(_CONTAINERS):
        containers = [_CONTAINERS[kind](source) for source, kind in known]
        return MessageLog(name, parts, containers, options)
    if len(kinds) > 1:
        raise LogError(f"{name} are of different formats ({', '.join(sorted(kinds))}): name one")
    return TextLog(name, parts, _PARSERS[kinds.pop()](name, parts, options), options)


_CONTAINERS: dict[str, Callable[[Source], Container]] = {
    "MCAP": McapContainer,
    "ROS 1 bag": Rosbag1Container,
    "sqlite3": SqliteContainer,
}
_PARSERS: dict[str, type[CarmenParser | CsvParser]] = {"CARMEN": CarmenParser, "CSV": CsvParser}
_MAGICS = {
    mcap_records.MAGIC: "MCAP",
    rosbag1_records.MAGIC: "ROS 1 bag",
    sqlite_container.MAGIC: "sqlite3",
}


def _kind_of(source: Source) -> str | None:
    """The format of a source; None for a file of a folder that is no log."""
    try:
        with source.open() as stream:
            start = read_up_to(stream, _SNIFFED_BYTES)
            kind = next((k for magic, k in _MAGICS.items() if start.startswith(magic)), None)
            rest = stream
            if kind is None and b"\0" not in start:
                rest = put_back(start, stream)
                kind, start = _text_kind(rest)
            source.keep(start, rest)
    except DamagedBytesError as error:
        raise LogError(f"{source.name}: {error}") from error
    if kind is not None or source.found:
        return kind
    if not start:
        raise LogError(f"{source.name} is empty")
    for magic, what in _NO_LOGS.items():
        if start.startswith(magic):
            raise LogError(f"{source.name} is {what}")
    raise LogError(f"{source.name} is not a log that bsmap reads: {_KNOWN}")


def _text_kind(stream: BinaryIO) -> tuple[str | None, bytes]:
    """The format of text by its first telling line, and all that was read to find it."""
    read = b""
    is_first = True
    while len(read) < _SNIFFED_TEXT_BYTES and (line := stream.readline(_SNIFFED_TEXT_BYTES)):
        read += line
        words = line.removeprefix(csv_scans.BYTE_ORDER_MARK).split(None, 1)
        if b"\0" in line:
            break
        if not words or words[0].startswith(b"#"):
            continue
        if words[0] in carmen_lines.ALL_WORDS:
            return "CARMEN", read
        if is_first and csv_scans.is_header(line):
            return "CSV", read
        is_first = False
    return None, read
