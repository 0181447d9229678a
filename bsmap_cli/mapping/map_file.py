"""The map file `.bsm`, version 1: a magic, chunks with checksums, little-endian, no clock in it."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np

from bsmap_cli.errors import MapFileError
from bsmap_cli.mapping.chunk_stream import Chunk, ChunkReader, ChunkWriter, refuse
from bsmap_cli.mapping.level_chunk import LEVEL_HEAD, level_payload, read_level
from bsmap_cli.mapping.level_rules import document_fault
from bsmap_cli.mapping.map_chunks import (
    Head,
    head_payload,
    meta_payload,
    path_payload,
    read_end,
    read_head,
    read_meta,
    read_path,
)
from bsmap_cli.mapping.map_document import MapDocument, MapLevel


@dataclass(frozen=True, slots=True)
class MapSizes:
    """Bytes of a map file: in all, of the path chunk's payload, and of each level's arrays."""

    file_bytes: int
    path_bytes: int
    level_bytes: tuple[int, ...]


def write_map(
    stream: BinaryIO, document: MapDocument, *, compress: bool = False, with_path: bool = True
) -> MapSizes:
    """Write the map; the same document gives the same bytes.

    compress : encoding 1, which rounds coordinates to the nearest 2^-10 m; otherwise encoding 0.
    with_path : keep the thinned path, so that the map alone yields free space.
    MapFileError where the document breaks a rule of the format.
    """
    fault = document_fault(document)
    if fault is not None:
        raise MapFileError(f"the map cannot be written: {fault}")
    writer = ChunkWriter(stream)
    writer.chunk(b"HEAD", head_payload(document))
    writer.chunk(b"META", meta_payload(document.meta))
    level_bytes: list[int] = []
    for level in document.levels:
        payload = level_payload(level, compress)
        writer.chunk(b"LEVL", payload)
        level_bytes.append(len(payload) - LEVEL_HEAD.size)
    path = path_payload(document.path) if with_path and len(document.path) else b""
    if path:
        writer.chunk(b"path", path)
    writer.chunk(b"IEND", struct.pack("<I", writer.file_crc))
    return MapSizes(writer.file_bytes, len(path), tuple(level_bytes))


def read_map(stream: BinaryIO) -> MapDocument:
    """Read a map of version 1 from a stream that need not be seekable.

    Arrays of raw levels are read-only views. MapFileError names the byte and what was expected
    there: wrong magic, later version, unknown critical chunk, bad crc, counts that do not add up,
    points that are not finite, a file that ends early or goes on behind its end.
    """
    return read_map_with_sizes(stream)[0]


def read_map_with_sizes(stream: BinaryIO) -> tuple[MapDocument, MapSizes]:
    """What `read_map` gives, and how many bytes its parts take in the file."""
    reader = ChunkReader(stream)
    head = read_head(reader, reader.next_chunk())
    meta: dict[str, Any] | None = None
    levels: list[MapLevel] = []
    level_bytes: list[int] = []
    path, path_bytes = np.zeros((0, 3), np.float32), 0
    while (chunk := reader.next_chunk()).type != b"IEND":
        if chunk.type == b"META":
            _expect_first(chunk, meta is None)
            meta = read_meta(reader, chunk)
        elif chunk.type == b"LEVL":
            levels.append(_next_level(reader, chunk, head, levels))
            level_bytes.append(chunk.length - LEVEL_HEAD.size)
        elif chunk.type == b"path":
            _expect_first(chunk, path_bytes == 0)
            path, path_bytes = read_path(reader, chunk), chunk.length
        else:
            _expect_first(chunk, chunk.type != b"HEAD")
            if chunk.critical:
                known = "a chunk known to version 1 (HEAD, META, LEVL, IEND)"
                refuse(chunk.start - 4, known, chunk.type.decode())
            reader.finish(chunk)
    read_end(reader, chunk)
    _check_totals(chunk, head, levels)
    document = MapDocument(
        degree=head.degree,
        max_weight=head.max_weight,
        levels=tuple(levels),
        meta=meta or {},
        path=path,
        parts=bool(head.flags & 1),
    )
    return document, MapSizes(reader.offset, path_bytes, tuple(level_bytes))


def _expect_first(chunk: Chunk, first: bool) -> None:
    if not first:
        refuse(chunk.start - 4, f"one {chunk.type.decode()} chunk", "another")


def _next_level(reader: ChunkReader, chunk: Chunk, head: Head, before: list[MapLevel]) -> MapLevel:
    return read_level(
        reader,
        chunk,
        degree=head.degree,
        coarser_m=before[-1].knot_step_m if before else math.inf,
        most_curves=head.curves - sum(len(level) for level in before),
        most_points=head.points - sum(len(level.weights) for level in before),
    )


def _check_totals(end: Chunk, head: Head, levels: list[MapLevel]) -> None:
    curves = sum(len(level) for level in levels)
    points = sum(len(level.weights) for level in levels)
    if (len(levels), curves, points) != (head.levels, head.curves, head.points):
        expected = f"{head.levels} levels, {head.curves} curves, {head.points} control points"
        found = f"{len(levels)} levels, {curves} curves, {points} control points"
        refuse(end.start, expected, found)
