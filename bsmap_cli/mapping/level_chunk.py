"""The LEVL chunk of a map file: its head, its arrays, and the places of its faults."""

from __future__ import annotations

import struct

from bsmap_cli.mapping.chunk_stream import Chunk, ChunkReader, refuse
from bsmap_cli.mapping.level_codec import (
    BLOCK_HEAD,
    LevelHead,
    decode_compressed,
    decode_raw,
    encode_compressed,
    encode_raw,
)
from bsmap_cli.mapping.level_rules import Fault, find_fault
from bsmap_cli.mapping.map_document import MapLevel

LEVEL_HEAD = struct.Struct("<dIIB7x")
RAW, COMPRESSED = 0, 1


def level_payload(level: MapLevel, compress: bool) -> bytes:
    """The payload of one level in encoding 1 (compress) or 0."""
    encoding = COMPRESSED if compress else RAW
    head = LEVEL_HEAD.pack(level.knot_step_m, len(level), len(level.weights), encoding)
    return head + (encode_compressed(level) if compress else encode_raw(level))


def read_level(
    reader: ChunkReader,
    chunk: Chunk,
    *,
    degree: int,
    coarser_m: float,
    most_curves: int,
    most_points: int,
) -> MapLevel:
    """Read one level; its counts are checked before its arrays are believed.

    coarser_m : knot step of the level before, infinite for the first one.
    most_curves, most_points : what the file's head leaves for this level.
    """
    if chunk.length < LEVEL_HEAD.size:
        refuse(chunk.start - 8, f"a LEVL of {LEVEL_HEAD.size} bytes or more", f"{chunk.length}")
    fields = LEVEL_HEAD.unpack(reader.payload(LEVEL_HEAD.size, "the head of a LEVL"))
    step_m, curves, points, encoding = fields
    head = LevelHead(degree, step_m, curves, points)
    if not 0.0 < step_m < coarser_m:
        refuse(chunk.start, f"a knot step above 0 and below {coarser_m} m", f"{step_m}")
    if curves > most_curves or points > most_points:
        expected = f"at most {most_curves} curves and {most_points} control points, as HEAD says"
        refuse(chunk.start + 8, expected, f"{curves} and {points}")
    size = chunk.length - LEVEL_HEAD.size
    if encoding == RAW and size != head.raw_bytes:
        expected = f"{head.raw_bytes} bytes of arrays for {curves} curves, {points} control points"
        refuse(chunk.start - 8, expected, f"{size}")
    if encoding == COMPRESSED and size < BLOCK_HEAD.size:
        refuse(chunk.start - 8, f"{BLOCK_HEAD.size} bytes or more of streams", f"{size}")
    if encoding not in (RAW, COMPRESSED):
        refuse(chunk.start + 16, "encoding 0 (raw) or 1 (compressed)", f"{encoding}")
    body = reader.payload(size, "the payload of chunk LEVL")
    reader.finish(chunk)
    return _decode(body, head, encoding, chunk.start + LEVEL_HEAD.size)


def _decode(body: bytes, head: LevelHead, encoding: int, base: int) -> MapLevel:
    """The checked level; `base` is the first byte of `body` in the file."""
    if encoding == RAW:
        level = decode_raw(body, head)
    else:
        try:
            level = decode_compressed(body, head)
        except ValueError as error:
            expected, _, found = str(error).partition(", found ")
            refuse(base, expected, found)
    fault = find_fault(level, head.points)
    if fault is not None:
        place = base + (_place(fault, head.curves) if encoding == RAW else 0)
        refuse(place, fault.expected, fault.found)
    return level


def _place(fault: Fault, curves: int) -> int:
    """Bytes from the start of raw arrays to the faulty value."""
    first, stride = {
        "curve_ids": (0, 16),
        "taus": (4, 16),
        "first_indices": (16 * curves, 8),
        "point_counts": (16 * curves + 4, 8),
        "control_points": (24 * curves, 8),
    }[fault.array]
    return first + stride * fault.row
