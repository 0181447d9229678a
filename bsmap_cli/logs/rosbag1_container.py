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
from bsmap_cli.logs.messages import Channel, ContainerIndex, RawMessage
from bsmap_cli.logs.reader import ReadReport
from bsmap_cli.logs.rosbag1_records import (
    MAGIC,
    U32,
    BagDamageError,
    Connections,
    Fields,
    Op,
    index_of,
    kind_of_record,
    next_record,
    records_within,
)
from bsmap_cli.logs.sources import Source


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
                return index_of(file)
        except (OSError, BagDamageError, struct.error, KeyError):
            return None  # damage is told when the messages are read

    def messages(
        self, wants: Callable[[Channel], bool], report: ReadReport
    ) -> Iterator[RawMessage]:
        """See `Container`; a chunk that cannot be unpacked is left out."""
        connections = Connections(wants)
        try:
            with self._source.open() as stream:
                read_up_to(stream, len(MAGIC))
                yield from self._records(stream, connections, report)
        except (BagDamageError, DamagedBytesError) as error:
            report.lose(f"{self.name}: {error}; what comes before is used")

    def _records(
        self, stream: BinaryIO, connections: Connections, report: ReadReport
    ) -> Iterator[RawMessage]:
        chunks_missing: int | None = None
        while (record := next_record(stream)) is not None:
            fields, data, is_cut = record
            kind = kind_of_record(fields)
            if kind == Op.BAG_HEADER and fields.get(b"index_pos", b"") != bytes(8):
                chunks_missing = int.from_bytes(fields.get(b"chunk_count", b""), "little")
            elif kind == Op.CHUNK:
                chunks_missing = chunks_missing and chunks_missing - 1
                yield from self._chunk(fields, data, is_cut, connections, report)
            elif kind == Op.CHUNK_INFO:
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
        fields: Fields,
        data: bytes,
        is_cut: bool,
        connections: Connections,
        report: ReadReport,
    ) -> Iterator[RawMessage]:
        try:
            (size_bytes,) = U32.unpack(fields.get(b"size", b""))
            compression = fields.get(b"compression", b"none").decode("ascii", "replace")
            content = unpack_chunk(data, compression, size_bytes, is_cut=is_cut)
        except (DamagedBytesError, struct.error) as error:
            report.lose(f"{self.name}: a damaged chunk is left out: {error}")
            return
        try:
            for inner, start, end in records_within(content):
                yield from connections.take(
                    kind_of_record(inner), inner, memoryview(content)[start:end]
                )
        except BagDamageError as error:
            if not is_cut:
                report.lose(f"{self.name}: the rest of a damaged chunk is left out: {error}")
