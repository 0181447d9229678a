"""The payload of a LEVL chunk: raw arrays, or quantised residuals in compressed varints."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.errors import MapFileError
from bsmap_cli.mapping.decompression import ZSTD, decompress
from bsmap_cli.mapping.map_document import MapLevel
from bsmap_cli.mapping.varints import (
    Integers,
    decode_varints,
    encode_varints,
    segmented_differences,
    segmented_sums,
    unzigzag,
    zigzag,
)

RECORD = np.dtype(
    [("id", "<u4"), ("start", "<f4"), ("end", "<f4"), ("flags", "<u2"), ("obs", "<u2")]
)
KNOTS = np.dtype([("first", "<i4"), ("n", "<i4")])
BLOCK_HEAD = struct.Struct("<dB7xI")
QUANTUM_M = 2.0**-10
Narrow = TypeVar("Narrow", bound=np.signedinteger[Any] | np.unsignedinteger[Any])

ZSTD_LEVEL = 19
LARGEST_QUANTUM_COUNT = 2.0**53


@dataclass(frozen=True, slots=True)
class LevelHead:
    """What the first 24 bytes of a level say: degree is the file's."""

    degree: int
    knot_step_m: float
    curves: int
    points: int

    @property
    def raw_bytes(self) -> int:
        """Bytes of the arrays in encoding 0."""
        return 24 * self.curves + 9 * self.points

    @property
    def most_stream_bytes(self) -> int:
        """Bytes that the streams of encoding 1 take at most before compression."""
        return 44 + 43 * self.curves + 30 * self.points


def encode_raw(level: MapLevel) -> bytes:
    """Encoding 0: records, knots, points, weights."""
    records = np.zeros(len(level), RECORD)
    records["id"], records["flags"], records["obs"] = (
        level.curve_ids,
        level.flags,
        level.observations,
    )
    records["start"], records["end"] = level.tau_start_m, level.tau_end_m
    knots = np.zeros(len(level), KNOTS)
    knots["first"], knots["n"] = level.first_indices, level.point_counts + level.degree + 1
    points = np.ascontiguousarray(level.control_points, "<f4")
    return b"".join(
        array.tobytes() for array in (records, knots, points, level.weights.astype(np.uint8))
    )


def decode_raw(body: bytes, head: LevelHead) -> MapLevel:
    """The level of an encoding 0 payload of exactly `head.raw_bytes`: views, no copies."""
    curves, points = head.curves, head.points
    records = np.frombuffer(body, RECORD, curves)
    knots = np.frombuffer(body, KNOTS, curves, 16 * curves)
    return MapLevel(
        degree=head.degree,
        knot_step_m=head.knot_step_m,
        curve_ids=records["id"],
        tau_start_m=records["start"],
        tau_end_m=records["end"],
        flags=records["flags"],
        observations=records["obs"],
        first_indices=knots["first"],
        point_counts=knots["n"].astype(np.int64) - head.degree - 1,
        control_points=np.frombuffer(body, "<f4", 2 * points, 24 * curves).reshape(points, 2),
        weights=np.frombuffer(body, np.uint8, points, 24 * curves + 8 * points),
    )


def encode_compressed(level: MapLevel) -> bytes:
    """Encoding 1 with zstd: at most half of `QUANTUM_M` is lost on each coordinate."""
    import zstandard

    firsts = level.offsets()[:-1]
    quanta = np.rint(level.control_points.astype(np.float64) / QUANTUM_M)
    if np.abs(quanta).max(initial=0.0) >= LARGEST_QUANTUM_COUNT:
        raise MapFileError("the map is too far from its origin to be compressed: write it raw")
    streams = [
        _delta_varints(level.curve_ids),
        level.tau_start_m.astype("<f4").tobytes() + level.tau_end_m.astype("<f4").tobytes(),
        encode_varints(level.flags.astype(np.uint64)),
        encode_varints(level.observations.astype(np.uint64)),
        _delta_varints(level.first_indices),
        encode_varints((level.point_counts + level.degree + 1).astype(np.uint64)),
        *(_residual_varints(quanta[:, axis].astype(np.int64), firsts) for axis in (0, 1)),
        encode_varints(zigzag(segmented_differences(level.weights.astype(np.int64), firsts))),
    ]
    block = b"".join(struct.pack("<I", len(stream)) + stream for stream in streams)
    compressed = zstandard.ZstdCompressor(level=ZSTD_LEVEL).compress(block)
    return BLOCK_HEAD.pack(QUANTUM_M, ZSTD, len(block)) + compressed


def decode_compressed(body: bytes, head: LevelHead) -> MapLevel:
    """The level of an encoding 1 payload; ValueError says what was expected and what found."""
    quantum_m, codec, length = BLOCK_HEAD.unpack_from(body)
    if not (np.isfinite(quantum_m) and quantum_m > 0.0):
        raise ValueError(f"a positive quantum, found {quantum_m}")
    if length > head.most_stream_bytes:
        raise ValueError(
            f"at most {head.most_stream_bytes} bytes of streams for {head.curves} curves and"
            f" {head.points} control points, found {length}"
        )
    streams = _split(decompress(body[BLOCK_HEAD.size :], codec, length))
    curves, points = head.curves, head.points
    taus = np.frombuffer(streams[1], "<f4")
    if len(taus) != 2 * curves:
        raise ValueError(f"{2 * curves} tau limits, found {len(taus)}")
    knots = _narrow(decode_varints(streams[5], curves).view(np.int64), np.int32)
    counts = knots.astype(np.int64) - head.degree - 1
    if counts.min(initial=1) < 1 or counts.sum() != points:
        raise ValueError(f"knot counts that give {points} control points")
    firsts = np.cumsum(counts) - counts
    coordinates = np.stack(
        [
            _from_residuals(unzigzag(decode_varints(stream, points)), firsts) * quantum_m
            for stream in streams[6:8]
        ],
        axis=1,
    )
    with np.errstate(over="ignore"):  # refused as not finite by whoever checks the level
        control_points = coordinates.astype(np.float32)
    weights = segmented_sums(unzigzag(decode_varints(streams[8], points)), firsts)
    return MapLevel(
        degree=head.degree,
        knot_step_m=head.knot_step_m,
        curve_ids=_narrow(_running(streams[0], curves), np.uint32),
        tau_start_m=taus[:curves],
        tau_end_m=taus[curves:],
        flags=_narrow(decode_varints(streams[2], curves).view(np.int64), np.uint16),
        observations=_narrow(decode_varints(streams[3], curves).view(np.int64), np.uint16),
        first_indices=_narrow(_running(streams[4], curves), np.int32),
        point_counts=counts,
        control_points=control_points,
        weights=_narrow(weights, np.uint8),
    )


def _delta_varints(values: NDArray[np.uint32] | NDArray[np.int32]) -> bytes:
    differences = values.astype(np.int64)
    differences[1:] -= differences[:-1].copy()
    return encode_varints(zigzag(differences))


def _running(stream: bytes, count: int) -> Integers:
    return np.cumsum(unzigzag(decode_varints(stream, count)))


def _residual_varints(quanta: Integers, firsts: Integers) -> bytes:
    """Second differences within a curve: the first value as it is, the second as a difference."""
    residuals = segmented_differences(quanta, firsts)
    seconds = np.diff(residuals, prepend=0)
    seconds[firsts] = quanta[firsts]
    lengths = np.diff(firsts, append=len(quanta))
    followers = firsts[lengths > 1] + 1
    seconds[followers] = residuals[followers]
    return encode_varints(zigzag(seconds))


def _from_residuals(residuals: Integers, firsts: Integers) -> Integers:
    differences = residuals.copy()
    differences[firsts] = 0  # the running sum of differences begins with the second value
    differences = segmented_sums(differences, firsts)
    differences[firsts] = residuals[firsts]
    return segmented_sums(differences, firsts)


def _narrow(values: Integers, dtype: type[Narrow]) -> NDArray[Narrow]:
    limits = np.iinfo(dtype)
    if len(values) and (values.min() < limits.min or values.max() > limits.max):
        raise ValueError(f"values that fit {limits.dtype}, found {values.min()} .. {values.max()}")
    return values.astype(dtype)


def _split(block: bytes) -> list[bytes]:
    streams, at = [], 0
    for name in ("ids", "taus", "flags", "observations", "I", "n", "x", "y", "weights"):
        length = int.from_bytes(block[at : at + 4], "little")
        stream = block[at + 4 : at + 4 + length]
        if at + 4 > len(block) or len(stream) != length:
            raise ValueError(f"stream {name} of {length} bytes, found {len(stream)}")
        streams.append(stream)
        at += 4 + length
    if at != len(block):
        raise ValueError(f"{at} bytes in the streams, found {len(block)}")
    return streams
