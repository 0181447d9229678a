"""MCAP files and streams, whole or cut: https://mcap.dev/spec.

Records are framed here rather than by the `mcap` package, so that every declared length is
checked before it is believed, a damaged chunk costs that chunk alone, and a cut chunk still gives
what it holds. The package reads schemas and channels.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from typing import BinaryIO

from bsmap_cli.logs.byte_streams import DamagedBytesError, read_up_to
from bsmap_cli.logs.chunks import unpack_chunk
from bsmap_cli.logs.mcap_records import (
    FRAME,
    MAGIC,
    MESSAGE,
    ChannelTable,
    McapDamageError,
    Opcode,
    chunk_header,
    index_from_summary,
)
from bsmap_cli.logs.messages import Channel, ContainerIndex, RawMessage
from bsmap_cli.logs.reader import ReadReport
from bsmap_cli.logs.sources import Source

RECORD_LIMIT_BYTES = 1 << 28


class McapContainer:
    """One MCAP file or stream."""

    format = "MCAP"

    def __init__(self, source: Source) -> None:
        self.name = source.name
        self._source = source

    def index(self) -> ContainerIndex | None:
        """From the summary section; None for a stream or a file without one."""
        path = self._source.plain_path
        return index_from_summary(path) if path else None

    def messages(
        self, wants: Callable[[Channel], bool], report: ReadReport
    ) -> Iterator[RawMessage]:
        """See `Container`; a chunk whose checksum fails is left out."""
        channels = ChannelTable(wants)
        try:
            with self._source.open() as stream:
                yield from self._records(stream, channels, report)
        except (McapDamageError, DamagedBytesError) as error:
            report.lose(f"{self.name}: {error}; what comes before is used")

    def _records(
        self, stream: BinaryIO, channels: ChannelTable, report: ReadReport
    ) -> Iterator[RawMessage]:
        checksum = zlib.crc32(read_up_to(stream, len(MAGIC)))
        while True:
            frame = read_up_to(stream, FRAME.size)
            if len(frame) < FRAME.size:
                raise McapDamageError("the file is cut off")
            opcode, length = FRAME.unpack(frame)
            if opcode == Opcode.FOOTER:
                return
            if length > RECORD_LIMIT_BYTES:
                raise McapDamageError(f"a record claims {length} bytes")
            payload = read_up_to(stream, length)
            is_cut = len(payload) < length
            if opcode == Opcode.MESSAGE and not is_cut:
                yield from channels.message(payload)
            elif opcode == Opcode.CHUNK:
                yield from self._chunk(payload, is_cut, channels, report)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and not is_cut:
                channels.declare(opcode, payload)
            elif opcode == Opcode.DATA_END and not is_cut:
                if int.from_bytes(payload[:4], "little") not in (0, checksum):
                    report.lose(f"{self.name}: the checksum over all messages does not hold")
                return
            if is_cut:
                raise McapDamageError("the file is cut off")
            checksum = zlib.crc32(payload, zlib.crc32(frame, checksum))

    def _chunk(
        self, payload: bytes, is_cut: bool, channels: ChannelTable, report: ReadReport
    ) -> Iterator[RawMessage]:
        try:
            header = chunk_header(payload)
            data = unpack_chunk(header.data, header.compression, header.size_bytes, is_cut=is_cut)
            if header.checksum and not is_cut and zlib.crc32(data) != header.checksum:
                raise McapDamageError("its checksum does not hold")
        except (McapDamageError, DamagedBytesError) as error:
            if not is_cut:
                report.lose(f"{self.name}: a damaged chunk is left out: {error}")
            return
        yield from _chunk_messages(memoryview(data), channels)


def _chunk_messages(data: memoryview, channels: ChannelTable) -> Iterator[RawMessage]:
    position, end = 0, len(data)
    wanted = channels.wanted
    declared, message = (int(Opcode.SCHEMA), int(Opcode.CHANNEL)), int(Opcode.MESSAGE)
    while position + FRAME.size <= end:
        opcode, length = FRAME.unpack_from(data, position)
        start = position + FRAME.size
        position = start + length
        if position > end:
            return
        if opcode == message:
            if length >= MESSAGE.size:
                channel_id, log_time_ns = MESSAGE.unpack_from(data, start)
                channel = wanted.get(channel_id)
                if channel is not None:
                    yield channel, log_time_ns, data[start + MESSAGE.size : position]
        elif opcode in declared:
            channels.declare(opcode, bytes(data[start:position]))
