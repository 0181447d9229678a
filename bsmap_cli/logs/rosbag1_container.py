"""ROS 1 bags, format 2.0, whole or cut: http://wiki.ros.org/Bags/Format/2.0.

Read from front to back without the index, so that a bag streams from a pipe and a bag that was
cut off, or never closed, still gives what it holds.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import BinaryIO

from bsmap_cli.logs.byte_streams import DamagedBytesError, read_up_to
from bsmap_cli.logs.chunks import unpack_chunk
from bsmap_cli.logs.messages import SECOND_NS, Channel, ContainerIndex, RawMessage, normal_type
from bsmap_cli.logs.reader import ReadReport
from bsmap_cli.logs.sources import Source

MAGIC = b"#ROSBAG V2.0\n"
RECORD_LIMIT_BYTES = 1 << 28
_HEADER_LIMIT_BYTES = 1 << 20
_U32 = struct.Struct("<I")
_TIME = struct.Struct("<II")
_MESSAGE, _BAG_HEADER, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 4, 5, 6, 7

_Fields = dict[bytes, bytes]


class BagDamageError(Exception):
    """A record contradicts the format."""


class Rosbag1Container:
    """One ROS 1 bag, a file or a stream."""

    format = "ROS 1 bag"

    def __init__(self, source: Source) -> None:
        self.name = source.name
        self._source = source

    def index(self) -> ContainerIndex | None:
        """From the records behind the last chunk; None for a stream or an unclosed bag."""
        path = self._source.plain_path
        if path is None:
            return None
        try:
            with path.open("rb") as file:
                return _index_of(file)
        except (OSError, BagDamageError, struct.error, KeyError):
            return None  # damage is told when the messages are read

    def messages(
        self, wants: Callable[[Channel], bool], report: ReadReport
    ) -> Iterator[RawMessage]:
        """See `Container`; a chunk that cannot be unpacked is left out."""
        connections = _Connections(wants)
        try:
            with self._source.open() as stream:
                read_up_to(stream, len(MAGIC))
                yield from self._records(stream, connections, report)
        except (BagDamageError, DamagedBytesError) as error:
            report.lose(f"{self.name}: {error}; what comes before is used")

    def _records(
        self, stream: BinaryIO, connections: _Connections, report: ReadReport
    ) -> Iterator[RawMessage]:
        chunks_missing: int | None = None
        while (record := _next_record(stream)) is not None:
            fields, data, is_cut = record
            kind = _kind(fields)
            if kind == _BAG_HEADER and fields.get(b"index_pos", b"") != bytes(8):
                chunks_missing = int.from_bytes(fields.get(b"chunk_count", b""), "little")
            elif kind == _CHUNK:
                chunks_missing = chunks_missing and chunks_missing - 1
                yield from self._chunk(fields, data, is_cut, connections, report)
            elif kind == _CHUNK_INFO:
                return
            elif not is_cut:
                yield from connections.take(kind, fields, memoryview(data))
            if is_cut:
                raise BagDamageError("the bag is cut off")
        if chunks_missing is None:
            raise BagDamageError("the bag was never closed")
        if chunks_missing:
            raise BagDamageError("the bag is cut off")

    def _chunk(
        self,
        fields: _Fields,
        data: bytes,
        is_cut: bool,
        connections: _Connections,
        report: ReadReport,
    ) -> Iterator[RawMessage]:
        try:
            (size_bytes,) = _U32.unpack(fields.get(b"size", b""))
            compression = fields.get(b"compression", b"none").decode("ascii", "replace")
            content = unpack_chunk(data, compression, size_bytes, is_cut=is_cut)
        except (DamagedBytesError, struct.error) as error:
            report.lose(f"{self.name}: a damaged chunk is left out: {error}")
            return
        try:
            for inner, start, end in _records_within(content):
                yield from connections.take(_kind(inner), inner, memoryview(content)[start:end])
        except BagDamageError as error:
            if not is_cut:
                report.lose(f"{self.name}: the rest of a damaged chunk is left out: {error}")


class _Connections:
    """Connections met so far and whether their messages are wanted."""

    def __init__(self, wants: Callable[[Channel], bool]) -> None:
        self.channels: dict[bytes, Channel] = {}
        self._wanted: dict[bytes, Channel] = {}
        self._wants = wants

    def take(self, kind: int, fields: _Fields, data: memoryview) -> Iterator[RawMessage]:
        """Note a connection record, give a wanted message record, pass over others."""
        if kind == _MESSAGE:
            channel = self._wanted.get(fields.get(b"conn", b""))
            time = fields.get(b"time", b"")
            if channel is not None and len(time) == _TIME.size:
                seconds, nanoseconds = _TIME.unpack(time)
                yield channel, seconds * SECOND_NS + nanoseconds, data
        elif kind == _CONNECTION:
            self._declare(fields, bytes(data))

    def _declare(self, fields: _Fields, data: bytes) -> None:
        key = fields.get(b"conn", b"")
        if key in self.channels:
            return
        described = _fields_of(data)
        topic = fields.get(b"topic") or described.get(b"topic", b"")
        channel = Channel(
            topic=topic.decode("utf-8", "replace"),
            type=normal_type(described.get(b"type", b"").decode("utf-8", "replace")),
            encoding="ros1",
            schema_encoding="ros1msg",
            schema=described.get(b"message_definition", b""),
        )
        self.channels[key] = channel
        if self._wants(channel):
            self._wanted[key] = channel


def _next_record(stream: BinaryIO) -> tuple[_Fields, bytes, bool] | None:
    """Header fields and data of a record, and whether the stream ends inside the data."""
    lead = read_up_to(stream, _U32.size)
    if not lead:
        return None
    header = _sized(stream, lead, _HEADER_LIMIT_BYTES)
    length = read_up_to(stream, _U32.size)
    data, expected = _data(stream, length)
    return _fields_of(header), data, len(data) < expected


def _sized(stream: BinaryIO, lead: bytes, limit: int) -> bytes:
    if len(lead) < _U32.size:
        raise BagDamageError("the bag is cut off")
    (length,) = _U32.unpack(lead)
    if length > limit:
        raise BagDamageError(f"a record claims a head of {length} bytes")
    header = read_up_to(stream, length)
    if len(header) < length:
        raise BagDamageError("the bag is cut off")
    return header


def _data(stream: BinaryIO, lead: bytes) -> tuple[bytes, int]:
    if len(lead) < _U32.size:
        raise BagDamageError("the bag is cut off")
    (length,) = _U32.unpack(lead)
    if length > RECORD_LIMIT_BYTES:
        raise BagDamageError(f"a record claims {length} bytes")
    return read_up_to(stream, length), length


def _records_within(content: bytes) -> Iterator[tuple[_Fields, int, int]]:
    """Header fields, start and end of the data of each record of an unpacked chunk."""
    position, end = 0, len(content)
    while position + _U32.size <= end:
        (length,) = _U32.unpack_from(content, position)
        header_end = position + _U32.size + length
        if header_end + _U32.size > end:
            raise BagDamageError("a record is cut off")
        fields = _fields_of(content[position + _U32.size : header_end])
        (length,) = _U32.unpack_from(content, header_end)
        start = header_end + _U32.size
        position = start + length
        if position > end:
            raise BagDamageError("a record is cut off")
        yield fields, start, position


def _fields_of(header: bytes) -> _Fields:
    fields: _Fields = {}
    position = 0
    while position + _U32.size <= len(header):
        (length,) = _U32.unpack_from(header, position)
        position += _U32.size
        name, equals, value = header[position : position + length].partition(b"=")
        position += length
        if not equals or position > len(header):
            raise BagDamageError("a record has a damaged head")
        fields[name] = value
    return fields


def _kind(fields: _Fields) -> int:
    return int.from_bytes(fields.get(b"op", b""), "little")


def _index_of(file: BinaryIO) -> ContainerIndex | None:
    file.seek(len(MAGIC))
    header = _next_record(file)
    if header is None:
        return None
    (position,) = struct.unpack("<Q", header[0].get(b"index_pos", b""))
    if position == 0:
        return None
    file.seek(position)
    connections = _Connections(lambda channel: True)
    counts: dict[bytes, int] = {}
    spans: list[tuple[int, int]] = []
    while (record := _next_record(file)) is not None:
        fields, data, _ = record
        if _kind(fields) == _CHUNK_INFO:
            spans.append((_time_ns(fields[b"start_time"]), _time_ns(fields[b"end_time"])))
            for start in range(0, len(data) - 7, 8):
                key = data[start : start + 4]
                counts[key] = counts.get(key, 0) + _U32.unpack_from(data, start + 4)[0]
        else:
            for _ in connections.take(_kind(fields), fields, memoryview(data)):
                pass
    if len(spans) != int.from_bytes(header[0].get(b"chunk_count", b""), "little"):
        return None
    return ContainerIndex(
        counts={channel: counts.get(key, 0) for key, channel in connections.channels.items()},
        start_ns=min((start for start, _ in spans), default=0),
        end_ns=max((end for _, end in spans), default=0),
    )


def _time_ns(value: bytes) -> int:
    seconds, nanoseconds = _TIME.unpack(value)
    return int(seconds) * SECOND_NS + int(nanoseconds)
