"""The map file `.bsm`, version 1: a magic, chunks with checksums, little-endian, no clock in it."""

from __future__ import annotations

import json
import math
import struct
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.errors import MapFileError
from bsmap_cli.geometry.basis import MAX_DEGREE, MIN_DEGREE
from bsmap_cli.mapping.chunk_stream import Chunk, ChunkReader, ChunkWriter, refuse
from bsmap_cli.mapping.level_chunk import level_payload, read_level
from bsmap_cli.mapping.level_rules import find_fault, rows_not_finite
from bsmap_cli.mapping.map_document import MapDocument, MapLevel

MAJOR, MINOR = 1, 0
HEAD = struct.Struct("<HHBBBBII")


def write_map(
    stream: BinaryIO, document: MapDocument, *, compress: bool = False, with_path: bool = True
) -> None:
    """Write the map; the same document gives the same bytes.

    compress : encoding 1, which rounds coordinates to the nearest 2^-10 m; otherwise encoding 0.
    with_path : keep the thinned path, so that the map alone yields free space.
    MapFileError where the document breaks a rule of the format.
    """
    _check_document(document)
    writer = ChunkWriter(stream)
    curves = sum(len(level) for level in document.levels)
    points = sum(len(level.weights) for level in document.levels)
    head = (document.degree, document.max_weight, len(document.levels), int(document.parts))
    writer.chunk(b"HEAD", HEAD.pack(MAJOR, MINOR, *head, curves, points))
    writer.chunk(b"META", _dump_meta(document.meta))
    for level in document.levels:
        writer.chunk(b"LEVL", level_payload(level, compress))
    if with_path and len(document.path):
        path = np.ascontiguousarray(document.path, "<f4")
        writer.chunk(b"path", struct.pack("<I", len(path)) + path.tobytes())
    writer.chunk(b"IEND", struct.pack("<I", writer.file_crc))


def read_map(stream: BinaryIO) -> MapDocument:
    """Read a map of version 1 from a stream that need not be seekable.

    Arrays of raw levels are read-only views. MapFileError names the byte and what was expected
    there: wrong magic, later version, unknown critical chunk, bad crc, counts that do not add up,
    points that are not finite, a file that ends early or goes on behind its end.
    """
    reader = ChunkReader(stream)
    chunk = reader.next_chunk()
    head = _read_head(reader, chunk)
    meta: dict[str, Any] = {}
    levels: list[MapLevel] = []
    path = np.zeros((0, 3), np.float32)
    seen = {b"HEAD"}
    while (chunk := reader.next_chunk()).type != b"IEND":
        if chunk.type in seen and chunk.type in (b"HEAD", b"META", b"path"):
            refuse(chunk.start - 4, f"one {chunk.type.decode()} chunk", "another")
        seen.add(chunk.type)
        if chunk.type == b"META":
            meta = _read_meta(reader, chunk)
        elif chunk.type == b"LEVL":
            levels.append(
                read_level(
                    reader,
                    chunk,
                    degree=head.degree,
                    coarser_m=levels[-1].knot_step_m if levels else math.inf,
                    most_curves=head.curves - sum(len(level) for level in levels),
                    most_points=head.points - sum(len(level.weights) for level in levels),
                )
            )
        elif chunk.type == b"path":
            path = _read_path(reader, chunk)
        elif chunk.critical:
            known = "a chunk known to version 1 (HEAD, META, LEVL, IEND)"
            refuse(chunk.start - 4, known, chunk.type.decode())
        else:
            reader.finish(chunk)
    _read_end(reader, chunk)
    totals = (
        len(levels),
        sum(len(level) for level in levels),
        sum(len(level.weights) for level in levels),
    )
    if totals != (head.levels, head.curves, head.points):
        expected = f"{head.levels} levels, {head.curves} curves, {head.points} control points"
        refuse(chunk.start, expected, "{} levels, {} curves, {} control points".format(*totals))
    return MapDocument(
        degree=head.degree,
        max_weight=head.max_weight,
        levels=tuple(levels),
        meta=meta,
        path=path,
        parts=bool(head.flags & 1),
    )


def _dump_meta(meta: dict[str, Any]) -> bytes:
    try:
        text = json.dumps(
            meta, sort_keys=True, ensure_ascii=False, separators=(",", ":"), allow_nan=False
        )
    except (TypeError, ValueError) as error:
        raise MapFileError(f"the map's description cannot be written as JSON: {error}") from error
    return text.encode()


class _Head(NamedTuple):
    """The fields of the HEAD chunk."""

    major: int
    minor: int
    degree: int
    max_weight: int
    levels: int
    flags: int
    curves: int
    points: int


def _read_head(reader: ChunkReader, chunk: Chunk) -> _Head:
    if chunk.type != b"HEAD":
        refuse(chunk.start - 4, "chunk HEAD first", chunk.type.decode())
    major = reader.payload(min(2, chunk.length), "the version")
    version = int.from_bytes(major, "little")
    if version > MAJOR:
        raise MapFileError(
            f"the map is of version {version} at byte {chunk.start}, expected {MAJOR}:"
            " read it with a later bsmap"
        )
    if chunk.length != HEAD.size:
        refuse(chunk.start - 8, f"a HEAD of {HEAD.size} bytes", f"{chunk.length}")
    head = _Head._make(HEAD.unpack(major + reader.payload(HEAD.size - 2, "HEAD")))
    reader.finish(chunk)
    if version != MAJOR:
        refuse(chunk.start, f"version {MAJOR}", f"{version}")
    if not MIN_DEGREE <= head.degree <= MAX_DEGREE:
        expected = f"a degree from {MIN_DEGREE} to {MAX_DEGREE}"
        refuse(chunk.start + 4, expected, str(head.degree))
    if head.levels == 0:
        refuse(chunk.start + 6, "one level at least", "none")
    return head


def _read_meta(reader: ChunkReader, chunk: Chunk) -> dict[str, Any]:
    payload = reader.payload(chunk.length, "the payload of chunk META")
    reader.finish(chunk)
    try:
        meta = json.loads(payload.decode())
    except (ValueError, RecursionError) as error:
        refuse(chunk.start, "a JSON object in UTF-8", str(error))
    if not isinstance(meta, dict):
        refuse(chunk.start, "a JSON object", f"a JSON {type(meta).__name__}")
    return meta


def _read_path(reader: ChunkReader, chunk: Chunk) -> NDArray[np.float32]:
    count = int.from_bytes(reader.payload(min(4, chunk.length), "chunk path"), "little")
    if chunk.length != 4 + 12 * count:
        expected = f"{4 + 12 * count} bytes of path for {count} poses"
        refuse(chunk.start - 8, expected, f"{chunk.length}")
    poses = np.frombuffer(reader.payload(12 * count, "the payload of chunk path"), "<f4")
    reader.finish(chunk)
    path = poses.reshape(count, 3)
    bad = rows_not_finite(path)
    if len(bad):
        refuse(chunk.start + 4 + 12 * int(bad[0]), "a finite pose", str(path[bad[0]].tolist()))
    return path


def _read_end(reader: ChunkReader, chunk: Chunk) -> None:
    if chunk.length != 4:
        refuse(chunk.start - 8, "an IEND of 4 bytes", f"{chunk.length}")
    before = reader.file_crc
    declared = int.from_bytes(reader.payload(4, "chunk IEND"), "little")
    reader.finish(chunk)
    if declared != before:
        refuse(chunk.start, f"crc {before:08x} of all bytes before IEND", f"{declared:08x}")
    reader.expect_end()


def _check_document(document: MapDocument) -> None:
    steps = [level.knot_step_m for level in document.levels]
    if not steps or len(steps) > 255 or sorted(set(steps), reverse=True) != steps:
        raise MapFileError(f"a map has 1 to 255 levels, coarse to fine, not {steps}")
    for level in document.levels:
        if level.degree != document.degree:
            raise MapFileError(f"a level of degree {level.degree} in a map of {document.degree}")
        fault = find_fault(level, len(level.weights))
        if fault is not None:
            raise MapFileError(
                f"the map cannot be written: expected {fault.expected}, found {fault.found}"
                f" (row {fault.row} of {fault.array}, knot step {level.knot_step_m} m)"
            )
    if not np.isfinite(document.path).all():
        raise MapFileError("the map cannot be written: its path is not finite")
