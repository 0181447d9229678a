"""Bytes of a log, unpacked on the way: plain, `.gz` or `.zst`, from a file or from a pipe.

The streams made here never close the stream they were made from: who opened it closes it.
"""

from __future__ import annotations

import io
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from typing import BinaryIO, Protocol

GZIP_MAGIC = b"\x1f\x8b"
ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_FEED_BYTES = {GZIP_MAGIC: 8192, ZSTD_MAGIC: 512}
"""At a time: what these can unpack to is a matter of megabytes."""

_PIECE_BYTES = 1 << 20
_BUFFER_BYTES = 1 << 17


class DamagedBytesError(Exception):
    """The bytes end too early or contradict a checksum; what came before them is good."""


class _Decompressor(Protocol):
    """What `zlib.decompressobj` and `zstandard`'s have in common."""

    @property
    def eof(self) -> bool: ...

    @property
    def unused_data(self) -> bytes: ...

    def decompress(self, data: bytes, /) -> bytes: ...


@contextmanager
def _failing_disk() -> Iterator[None]:
    """A bad sector, or a share that went away, is damage like any other."""
    try:
        yield
    except OSError as error:
        raise DamagedBytesError(f"reading fails ({error.strerror or error})") from error


class _Unread(io.RawIOBase):
    """A stream with bytes put back in front of it."""

    def __init__(self, front: bytes, rest: BinaryIO) -> None:
        self._front = front
        self._rest = rest
        self._read_some = getattr(rest, "read1", rest.read)

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        data = self._front[: len(buffer)]
        if data:
            self._front = self._front[len(data) :]
        else:
            with _failing_disk():
                data = self._read_some(len(buffer)) or b""
        buffer[: len(data)] = data
        return len(data)


class _Unpacked(io.RawIOBase):
    """Members of a compressed stream, one after the other.

    Input is fed in small pieces, so that a bomb unpacks a bounded part of itself at a time.
    """

    def __init__(self, packed: BinaryIO, magic: bytes) -> None:
        self._packed = packed
        self._magic = magic
        self._member: _Decompressor | None = None
        self._waiting = b""
        self._ready = memoryview(b"")
        self._ended = False

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        while not self._ready and not self._ended:
            self._fill()
        data = self._ready[: len(buffer)]
        self._ready = self._ready[len(data) :]
        buffer[: len(data)] = data
        return len(data)

    def _fill(self) -> None:
        packed = self._waiting or self._packed.read(_FEED_BYTES[self._magic])
        self._waiting = b""
        if self._member is None:
            self._ended = not packed
            packed = packed.lstrip(b"\0")  # padding that tape tools leave behind a member
            if not packed:
                return
            self._member = _new_member(self._magic)
        elif not packed:
            raise DamagedBytesError("the compressed data end too early")
        try:
            self._ready = memoryview(self._member.decompress(packed))
        except Exception as error:  # zlib.error, zstandard.ZstdError: imported only where used
            raise DamagedBytesError(f"the compressed data are damaged ({error})") from error
        if self._member.eof:
            self._waiting = self._member.unused_data
            self._member = None


def _new_member(magic: bytes) -> _Decompressor:
    if magic == GZIP_MAGIC:
        return zlib.decompressobj(wbits=31)
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj()


def put_back(front: bytes, stream: BinaryIO) -> io.BufferedReader:
    """The stream as if `front` had not been read from it."""
    return io.BufferedReader(_Unread(front, stream), _BUFFER_BYTES)


def is_packed(start: bytes) -> bool:
    """Whether bytes begin a `.gz` or `.zst`."""
    return start.startswith((GZIP_MAGIC, ZSTD_MAGIC))


def unpack(stream: BinaryIO) -> BinaryIO:
    """The bytes behind `.gz` or `.zst`, told by their magic; other streams as they are."""
    with _failing_disk():
        start = read_up_to(stream, len(ZSTD_MAGIC))
    rest = put_back(start, stream)
    for magic in (GZIP_MAGIC, ZSTD_MAGIC):
        if start.startswith(magic):
            return io.BufferedReader(_Unpacked(rest, magic), _BUFFER_BYTES)
    return rest


def read_up_to(stream: BinaryIO, count: int) -> bytes:
    """`count` bytes, or fewer where the stream ends.

    Large counts are read piece by piece: what a hostile file declares is never allocated before
    the bytes are there.
    """
    if count <= _PIECE_BYTES:
        data = stream.read(count)
        if len(data) == count or not data:
            return data
    else:
        data = stream.read(_PIECE_BYTES)
    pieces = [data]
    missing = count - len(data)
    while missing > 0 and data:
        data = stream.read(min(missing, _PIECE_BYTES))
        pieces.append(data)
        missing -= len(data)
    return b"".join(pieces)
