"""Blocks of compressed levels, taken apart without believing what they declare."""

from __future__ import annotations

import zlib
from io import BytesIO

ZSTD, DEFLATE = 1, 2
PIECE = 1 << 20


def decompress(data: bytes, codec: int, length: int) -> bytes:
    """Exactly `length` bytes; ValueError where the data hold something else.

    Memory follows what the data really hold, never the length that is only declared.
    """
    if codec == ZSTD:
        block = _from_zstd(data, length + 1)
    elif codec == DEFLATE:
        block = _from_deflate(data, length + 1)
    else:
        raise ValueError(f"codec {ZSTD} (zstd) or {DEFLATE} (deflate), found {codec}")
    if len(block) != length:
        raise ValueError(f"{length} bytes of streams, found {len(block)} or more")
    return block


def _from_zstd(data: bytes, most: int) -> bytes:
    import zstandard

    pieces: list[bytes] = []
    try:
        reader = zstandard.ZstdDecompressor().stream_reader(BytesIO(data))
        while most and (piece := reader.read(min(most, PIECE))):
            pieces.append(piece)
            most -= len(piece)
    except zstandard.ZstdError as error:
        raise ValueError(f"zstd data, found {error}") from error
    return b"".join(pieces)


def _from_deflate(data: bytes, most: int) -> bytes:
    # a zlib header is told from bare deflate by its check bits
    wrapped = len(data) > 1 and data[0] & 15 == 8 and (data[0] * 256 + data[1]) % 31 == 0
    try:
        decoder = zlib.decompressobj(zlib.MAX_WBITS if wrapped else -zlib.MAX_WBITS)
        return decoder.decompress(data, most)
    except zlib.error as error:
        raise ValueError(f"deflate data, found {error}") from error
