"""The records of an MCAP file that a reader of scans needs."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from io import SEEK_END, BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from bsmap_cli.logs.messages import Channel, ContainerIndex, RawMessage, normal_type

if TYPE_CHECKING:
    from mcap.records import Schema

MAGIC = b"\x89MCAP0\r\n"
FRAME = struct.Struct("<BQ")
MESSAGE = struct.Struct("<H4xQ8x")  # channel, time of recording [ns]
_CHUNK = struct.Struct("<QQQII")
_LENGTH = struct.Struct("<Q")
_FOOTER = struct.Struct("<QQI")
_STATISTICS = struct.Struct("<26xQQI")
_COUNT = struct.Struct("<HQ")
_SUMMARY_LIMIT_BYTES = 1 << 26


class Opcode(IntEnum):
    """Kinds of records."""

    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    STATISTICS = 0x0B
    DATA_END = 0x0F


class McapDamageError(Exception):
    """A record contradicts the format or a checksum."""


@dataclass(frozen=True, slots=True)
class ChunkHeader:
    """A chunk before it is unpacked."""

    size_bytes: int
    checksum: int
    compression: str
    data: bytes


def chunk_header(payload: bytes) -> ChunkHeader:
    """The fields of a chunk record; of a cut one, the data that are there."""
    try:
        _, _, size_bytes, checksum, name_length = _CHUNK.unpack_from(payload)
        data_start = _CHUNK.size + name_length + _LENGTH.size
        name = payload[_CHUNK.size : _CHUNK.size + name_length].decode()
        (data_length,) = _LENGTH.unpack_from(payload, _CHUNK.size + name_length)
    except (struct.error, UnicodeDecodeError) as error:
        raise McapDamageError("a chunk has no proper head") from error
    return ChunkHeader(size_bytes, checksum, name, payload[data_start : data_start + data_length])


class ChannelTable:
    """Schemas and channels met so far; `wanted` holds the channels whose messages are drawn."""

    def __init__(self, wants: Callable[[Channel], bool]) -> None:
        self.wanted: dict[int, Channel] = {}
        self._wants = wants
        self._schemas: dict[int, Schema] = {}
        self._declared: set[int] = set()

    def declare(self, opcode: int, payload: bytes) -> None:
        """Take note of a schema or channel record; a damaged one is passed over."""
        from mcap import records
        from mcap.data_stream import ReadDataStream

        stream = ReadDataStream(BytesIO(payload))
        try:
            if opcode == Opcode.SCHEMA:
                schema = records.Schema.read(stream)
                self._schemas[schema.id] = schema
                return
            channel = records.Channel.read(stream)
        except Exception:  # the package lets struct, unicode and its own errors through
            return
        if channel.id in self._declared:
            return
        self._declared.add(channel.id)
        made = _channel_of(channel, self._schemas)
        if self._wants(made):
            self.wanted[channel.id] = made

    def message(self, payload: bytes) -> Iterator[RawMessage]:
        """The message of a record outside of chunks, if its channel is wanted."""
        if len(payload) >= MESSAGE.size:
            channel_id, log_time_ns = MESSAGE.unpack_from(payload)
            if channel_id in self.wanted:
                yield self.wanted[channel_id], log_time_ns, memoryview(payload)[MESSAGE.size :]


def _channel_of(channel: object, schemas: dict[int, Schema]) -> Channel:
    from mcap import records

    assert isinstance(channel, records.Channel)
    schema = schemas.get(channel.schema_id)
    return Channel(
        topic=channel.topic,
        type=normal_type(schema.name) if schema else "",
        encoding=channel.message_encoding,
        schema_encoding=schema.encoding if schema else "",
        schema=schema.data if schema else b"",
    )


def index_from_summary(path: Path) -> ContainerIndex | None:
    """What the summary section of a whole MCAP file says, or None."""
    try:
        with path.open("rb") as file:
            summary = _summary_of(file)
        return _index_of(summary) if summary else None
    except (OSError, struct.error):
        return None  # damage is told when the messages are read


def _summary_of(file: BinaryIO) -> bytes | None:
    end = file.seek(0, SEEK_END) - len(MAGIC)
    footer_start = end - FRAME.size - _FOOTER.size
    if footer_start < len(MAGIC):
        return None
    file.seek(footer_start)
    footer = file.read(FRAME.size + _FOOTER.size)
    opcode, length = FRAME.unpack_from(footer)
    summary_start, _, checksum = _FOOTER.unpack_from(footer, FRAME.size)
    size_bytes = footer_start - summary_start
    if (opcode, length) != (Opcode.FOOTER, _FOOTER.size):
        return None
    if not (summary_start and 0 < size_bytes <= _SUMMARY_LIMIT_BYTES):
        return None
    file.seek(summary_start)
    summary = file.read(size_bytes)
    is_good = checksum in (0, zlib.crc32(footer[:-4], zlib.crc32(summary)))
    return summary if is_good else None


def _index_of(summary: bytes) -> ContainerIndex | None:
    channels = ChannelTable(lambda channel: True)
    statistics = b""
    position = 0
    while position + FRAME.size <= len(summary):
        opcode, length = FRAME.unpack_from(summary, position)
        position += FRAME.size
        payload = summary[position : position + length]
        position += length
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            channels.declare(opcode, payload)
        elif opcode == Opcode.STATISTICS:
            statistics = payload
    if not statistics:
        return None
    start_ns, end_ns, _ = _STATISTICS.unpack_from(statistics)
    counts = dict(_COUNT.iter_unpack(statistics[_STATISTICS.size :]))
    if set(counts) - set(channels.wanted):
        return None  # the channels are not repeated in the summary
    return ContainerIndex(
        counts={channel: counts.get(key, 0) for key, channel in channels.wanted.items()},
        start_ns=start_ns,
        end_ns=end_ns,
    )
