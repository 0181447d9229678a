"""The records of a ROS 1 bag: http://wiki.ros.org/Bags/Format/2.0."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from enum import IntEnum
from typing import BinaryIO, TypeAlias

from bsmap_cli.logs.byte_streams import read_up_to
from bsmap_cli.logs.messages import SECOND_NS, Channel, ContainerIndex, RawMessage, normal_type

MAGIC = b"#ROSBAG V2.0\n"
RECORD_LIMIT_BYTES = 1 << 28
U32 = struct.Struct("<I")
_HEADER_LIMIT_BYTES = 1 << 20
_TIME = struct.Struct("<II")

Fields: TypeAlias = dict[bytes, bytes]
"""Names and values in the head of a record."""


class Op(IntEnum):
    """Kinds of records."""

    MESSAGE = 2
    BAG_HEADER = 3
    CHUNK = 5
    CHUNK_INFO = 6
    CONNECTION = 7


class BagDamageError(Exception):
    """A record contradicts the format."""


class Connections:
    """Connections met so far and whether their messages are wanted."""

    def __init__(self, wants: Callable[[Channel], bool]) -> None:
        self.channels: dict[bytes, Channel] = {}
        self._wanted: dict[bytes, Channel] = {}
        self._wants = wants

    def take(self, kind: int, fields: Fields, data: memoryview) -> Iterator[RawMessage]:
        """Note a connection record, give a wanted message record, pass over others."""
        if kind == Op.MESSAGE:
            channel = self._wanted.get(fields.get(b"conn", b""))
            time = fields.get(b"time", b"")
            if channel is not None and len(time) == _TIME.size:
                seconds, nanoseconds = _TIME.unpack(time)
                yield channel, seconds * SECOND_NS + nanoseconds, data
        elif kind == Op.CONNECTION:
            self._declare(fields, bytes(data))

    def _declare(self, fields: Fields, data: bytes) -> None:
        key = fields.get(b"conn", b"")
        if key in self.channels:
            return
        described = fields_of(data)
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


def next_record(stream: BinaryIO) -> tuple[Fields, bytes, bool] | None:
    """Header fields and data of a record, and whether the stream ends inside the data."""
    lead = read_up_to(stream, U32.size)
    if not lead:
        return None
    header = _sized(stream, lead, _HEADER_LIMIT_BYTES)
    length = read_up_to(stream, U32.size)
    data, expected = _data(stream, length)
    return fields_of(header), data, len(data) < expected


def _sized(stream: BinaryIO, lead: bytes, limit: int) -> bytes:
    if len(lead) < U32.size:
        raise BagDamageError("the bag is cut off")
    (length,) = U32.unpack(lead)
    if length > limit:
        raise BagDamageError(f"a record claims a head of {length} bytes")
    header = read_up_to(stream, length)
    if len(header) < length:
        raise BagDamageError("the bag is cut off")
    return header


def _data(stream: BinaryIO, lead: bytes) -> tuple[bytes, int]:
    if len(lead) < U32.size:
        raise BagDamageError("the bag is cut off")
    (length,) = U32.unpack(lead)
    if length > RECORD_LIMIT_BYTES:
        raise BagDamageError(f"a record claims {length} bytes")
    return read_up_to(stream, length), length


def records_within(content: bytes) -> Iterator[tuple[Fields, int, int]]:
    """Header fields, start and end of the data of each record of an unpacked chunk."""
    position, end = 0, len(content)
    while position + U32.size <= end:
        (length,) = U32.unpack_from(content, position)
        header_end = position + U32.size + length
        if header_end + U32.size > end:
            raise BagDamageError("a record is cut off")
        fields = fields_of(content[position + U32.size : header_end])
        (length,) = U32.unpack_from(content, header_end)
        start = header_end + U32.size
        position = start + length
        if position > end:
            raise BagDamageError("a record is cut off")
        yield fields, start, position


def fields_of(header: bytes) -> Fields:
    """Names and values of a head; raises BagDamageError where its lengths disagree."""
    fields: Fields = {}
    position = 0
    while position + U32.size <= len(header):
        (length,) = U32.unpack_from(header, position)
        position += U32.size
        name, equals, value = header[position : position + length].partition(b"=")
        position += length
        if not equals or position > len(header):
            raise BagDamageError("a record has a damaged head")
        fields[name] = value
    return fields


def kind_of_record(fields: Fields) -> int:
    """The kind of a record; see `Op` for those that matter."""
    return int.from_bytes(fields.get(b"op", b""), "little")


def index_of(file: BinaryIO) -> ContainerIndex | None:
    """What the records behind the last chunk say; None where they are not there."""
    file.seek(len(MAGIC))
    header = next_record(file)
    if header is None:
        return None
    (position,) = struct.unpack("<Q", header[0].get(b"index_pos", b""))
    if position == 0:
        return None
    file.seek(position)
    connections = Connections(lambda channel: True)
    counts: dict[bytes, int] = {}
    spans: list[tuple[int, int]] = []
    while (record := next_record(file)) is not None:
        fields, data, _ = record
        if kind_of_record(fields) == Op.CHUNK_INFO:
            spans.append((_time_ns(fields[b"start_time"]), _time_ns(fields[b"end_time"])))
            for start in range(0, len(data) - 7, 8):
                key = data[start : start + 4]
                counts[key] = counts.get(key, 0) + U32.unpack_from(data, start + 4)[0]
        else:
            for _ in connections.take(kind_of_record(fields), fields, memoryview(data)):
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
