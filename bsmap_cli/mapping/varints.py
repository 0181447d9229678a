"""Signed integers as zigzag LEB128 varints, whole arrays at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]

LONGEST = 10  # bytes that 64 bits can take


def encode_varints(values: NDArray[np.uint64]) -> bytes:
    """LEB128: seven bits a byte, lowest first, the top bit set on all bytes but the last."""
    lengths = np.ones(len(values), np.int64)
    rows = np.flatnonzero(values > 0x7F)
    longer = [rows]  # the values of more than one byte, more than two, ...
    while len(rows):
        lengths[rows] += 1
        rows = rows[values[rows] >> np.uint64(7 * len(longer)) > 0x7F]
        longer.append(rows)
    starts = np.cumsum(lengths) - lengths
    data = np.zeros(int(lengths.sum()), np.uint8)
    data[starts] = values & np.uint64(0x7F)
    for k, rows in enumerate(longer[:-1], 1):
        data[starts[rows] + k - 1] |= np.uint8(0x80)
        data[starts[rows] + k] = (values[rows] >> np.uint64(7 * k)) & np.uint64(0x7F)
    return data.tobytes()


def decode_varints(data: bytes, count: int) -> NDArray[np.uint64]:
    """The (count,) values of a LEB128 stream; ValueError where it does not hold so many."""
    stream = np.frombuffer(data, np.uint8)
    ends = np.flatnonzero(stream < 0x80)
    if len(ends) != count or (len(stream) > 0 and stream[-1] >= 0x80):
        raise ValueError(f"{count} varints, found {len(ends)} in {len(stream)} bytes")
    starts = np.zeros(count, np.int64)
    starts[1:] = ends[:-1] + 1
    values = (stream[starts] & np.uint8(0x7F)).astype(np.uint64)
    rows, k = np.flatnonzero(ends > starts), 1
    while len(rows):
        if k == LONGEST:
            raise ValueError(f"varints of at most {LONGEST} bytes, found a longer one")
        piece = (stream[starts[rows] + k] & np.uint8(0x7F)).astype(np.uint64)
        values[rows] |= piece << np.uint64(7 * k)
        k += 1
        rows = rows[ends[rows] - starts[rows] >= k]
    return values


def zigzag(values: Integers) -> NDArray[np.uint64]:
    """0, -1, 1, -2, ... as 0, 1, 2, 3, ...: small magnitudes become short varints."""
    return ((values << 1) ^ (values >> 63)).view(np.uint64)


def unzigzag(values: NDArray[np.uint64]) -> Integers:
    """The inverse of `zigzag`."""
    return (values >> np.uint64(1)).view(np.int64) ^ -(values & np.uint64(1)).view(np.int64)


def segmented_differences(values: Integers, firsts: Integers) -> Integers:
    """First differences within segments that begin at rows `firsts`; the first value as it is."""
    differences = np.diff(values, prepend=0)
    differences[firsts] = values[firsts]
    return differences


def segmented_sums(values: Integers, firsts: Integers) -> Integers:
    """The inverse of `segmented_differences`: running sums that begin anew at rows `firsts`."""
    sums = np.cumsum(values)
    lengths = np.diff(firsts, append=len(values))
    return sums - np.repeat(sums[firsts] - values[firsts], lengths)
