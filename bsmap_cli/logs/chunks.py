"""Compressed chunks inside MCAP files and ROS 1 bags."""

from __future__ import annotations

from typing import Any

from bsmap_cli.logs.byte_streams import DamagedBytesError

CHUNK_LIMIT_BYTES = 1 << 28
_FEED_BYTES = 512
_TRUSTED_RATIO = 256


def unpack_chunk(packed: bytes, compression: str, size_bytes: int, *, is_cut: bool) -> bytes:
    """The content of a chunk that claims to hold `size_bytes`.

    is_cut : the file ends inside the chunk; then what can be unpacked is the content.

    Raises DamagedBytesError where the bytes cannot be unpacked. Memory grows with what is really
    there, never with what is claimed.
    """
    if compression in ("", "none"):
        return packed
    if size_bytes > CHUNK_LIMIT_BYTES:
        raise DamagedBytesError(f"it claims {size_bytes} bytes")
    if not is_cut and size_bytes <= _TRUSTED_RATIO * len(packed):
        data, complete = _unpack_at_once(packed, compression, size_bytes)
    else:
        data, complete = _unpack_by_and_by(packed, compression, size_bytes, is_cut)
    if len(data) > size_bytes:
        raise DamagedBytesError("it holds more than it claims")
    if not (complete or is_cut):
        raise DamagedBytesError("its compressed data end too early")
    return data


def _unpack_at_once(packed: bytes, compression: str, size_bytes: int) -> tuple[bytes, bool]:
    try:
        if compression == "zstd":
            import zstandard

            if zstandard.frame_content_size(packed) > size_bytes:
                raise DamagedBytesError("it holds more than it claims")
            whole = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size_bytes)
            return whole, True
        decompressor = _new_decompressor(compression)
        data: bytes = decompressor.decompress(packed, max_length=size_bytes + 1)
    except DamagedBytesError:
        raise
    except Exception as error:  # each library has its own kind of damage
        raise DamagedBytesError(f"its compressed data are damaged ({error})") from error
    return data, decompressor.eof


def _unpack_by_and_by(
    packed: bytes, compression: str, size_bytes: int, is_cut: bool
) -> tuple[bytes, bool]:
    decompressor = _new_decompressor(compression)
    pieces: list[bytes] = []
    total = 0
    for start in range(0, len(packed), _FEED_BYTES):
        try:
            piece: bytes = decompressor.decompress(packed[start : start + _FEED_BYTES])
        except Exception as error:  # each library has its own kind of damage
            if is_cut:
                break
            raise DamagedBytesError(f"its compressed data are damaged ({error})") from error
        pieces.append(piece)
        total += len(piece)
        if total > size_bytes or decompressor.eof:
            return b"".join(pieces), True
    return b"".join(pieces), False


def _new_decompressor(compression: str) -> Any:
    if compression == "zstd":
        import zstandard

        return zstandard.ZstdDecompressor().decompressobj()
    if compression == "lz4":
        import lz4.frame

        return lz4.frame.LZ4FrameDecompressor()
    if compression == "bz2":
        import bz2

        return bz2.BZ2Decompressor()
    raise DamagedBytesError(f"its compression {compression!r} is not known")
