"""The small chunks of a map file: HEAD, META, path and IEND."""

from __future__ import annotations

import json
import struct
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.errors import MapFileError
from bsmap_cli.geometry.basis import MAX_DEGREE, MIN_DEGREE
from bsmap_cli.mapping.chunk_stream import Chunk, ChunkReader, refuse
from bsmap_cli.mapping.level_rules import rows_not_finite
from bsmap_cli.mapping.map_document import MapDocument

MAJOR, MINOR = 1, 0
HEAD = struct.Struct("<HHBBBBII")


def meta_payload(meta: dict[str, Any]) -> bytes:
    """JSON with sorted keys; MapFileError where the values are not JSON's."""
    try:
        text = json.dumps(
            meta, sort_keys=True, ensure_ascii=False, separators=(",", ":"), allow_nan=False
        )
    except (TypeError, ValueError) as error:
        raise MapFileError(f"the map's description cannot be written as JSON: {error}") from error
    return text.encode()


class Head(NamedTuple):
    """The fields of the HEAD chunk."""

    major: int
    minor: int
    degree: int
    max_weight: int
    levels: int
    flags: int
    curves: int
    points: int


def head_payload(document: MapDocument) -> bytes:
    """The head of a file that holds the document."""
    counts = (
        sum(len(level) for level in document.levels),
        sum(len(level.weights) for level in document.levels),
    )
    fields = (document.degree, document.max_weight, len(document.levels), int(document.parts))
    return HEAD.pack(MAJOR, MINOR, *fields, *counts)


def read_head(reader: ChunkReader, chunk: Chunk) -> Head:
    """The head, of a version, degree and number of levels that can be read."""
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
    head = Head._make(HEAD.unpack(major + reader.payload(HEAD.size - 2, "HEAD")))
    reader.finish(chunk)
    if version != MAJOR:
        refuse(chunk.start, f"version {MAJOR}", f"{version}")
    if not MIN_DEGREE <= head.degree <= MAX_DEGREE:
        expected = f"a degree from {MIN_DEGREE} to {MAX_DEGREE}"
        refuse(chunk.start + 4, expected, str(head.degree))
    if head.levels == 0:
        refuse(chunk.start + 6, "one level at least", "none")
    return head


def read_meta(reader: ChunkReader, chunk: Chunk) -> dict[str, Any]:
    """The description of the map."""
    payload = reader.payload(chunk.length, "the payload of chunk META")
    reader.finish(chunk)
    try:
        meta = json.loads(payload.decode())
    except (ValueError, RecursionError) as error:
        refuse(chunk.start, "a JSON object in UTF-8", str(error))
    if not isinstance(meta, dict):
        refuse(chunk.start, "a JSON object", f"a JSON {type(meta).__name__}")
    return meta


def path_payload(path: NDArray[np.float32]) -> bytes:
    """The number of poses and the poses."""
    return struct.pack("<I", len(path)) + np.ascontiguousarray(path, "<f4").tobytes()


def read_path(reader: ChunkReader, chunk: Chunk) -> NDArray[np.float32]:
    """(M, 3) float32 poses of the base in the map frame."""
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


def read_end(reader: ChunkReader, chunk: Chunk) -> None:
    """Check that nothing before the end was lost or changed, and that nothing follows."""
    if chunk.length != 4:
        refuse(chunk.start - 8, "an IEND of 4 bytes", f"{chunk.length}")
    before = reader.file_crc
    declared = int.from_bytes(reader.payload(4, "chunk IEND"), "little")
    reader.finish(chunk)
    if declared != before:
        refuse(chunk.start, f"crc {before:08x} of all bytes before IEND", f"{declared:08x}")
    reader.expect_end()
