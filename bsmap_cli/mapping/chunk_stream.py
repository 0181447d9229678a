"""The chunks of a map file: framing, checksums, and how damage is told."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from typing import BinaryIO, NoReturn

from bsmap_cli.errors import MapFileError

MAGIC = b"\x89BSM\r\n\x1a\n"
MAX_PAYLOAD = 2**32 - 1
PIECE = 1 << 16  # what is read at once before more of a declared length is believed


def refuse(offset: int, expected: str, found: str) -> NoReturn:
    """Raise the MapFileError of damage at a byte of the file."""
    raise MapFileError(
        f"damaged map at byte {offset}: expected {expected}, found {found};"
        " use another copy or make the map again"
    )


@dataclass(frozen=True, slots=True)
class Chunk:
    """The head of a chunk: its 4-byte type, its payload's length and first byte in the file."""

    type: bytes
    length: int
    start: int

    @property
    def critical(self) -> bool:
        """Whether a reader that does not know the type must refuse the file."""
        return self.type[:1].isupper()


class ChunkReader:
    """Reads chunks from a stream that need not be seekable, checking each against its crc.

    `next_chunk`, then `payload` in one or more pieces, then `finish`. Memory follows the bytes
    that are there, never a length that the file only declares.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._chunk_crc = 0
        self.offset = 0
        self.file_crc = 0  # of every byte before the chunk at hand
        self._running_crc = 0
        magic = self._take(len(MAGIC), "the magic of a .bsm map")
        if magic[:4] != MAGIC[:4] and magic[4:] != MAGIC[4:]:
            raise MapFileError(
                f"no map but another kind of file (byte 0: expected the magic {MAGIC.hex(' ')},"
                f" found {magic.hex(' ')}): name a .bsm, or its twin in JSON"
            )
        if magic != MAGIC:
            refuse(0, f"the magic {MAGIC.hex(' ')} of a .bsm map", magic.hex(" "))

    def next_chunk(self) -> Chunk:
        """Read the head of the next chunk."""
        self.file_crc = self._running_crc
        start = self.offset
        head = self._take(8, "the head of a chunk")
        length, type_ = struct.unpack("<I4s", head)
        if not (type_.isascii() and type_.isalpha()):
            refuse(start + 4, "a chunk type of four letters", repr(type_))
        self._chunk_crc = zlib.crc32(type_)
        return Chunk(type_, length, self.offset)

    def payload(self, count: int, what: str) -> bytes:
        """The next `count` bytes of the payload; `what` names them where the file ends early."""
        data = self._take(count, what)
        self._chunk_crc = zlib.crc32(data, self._chunk_crc)
        return data

    def finish(self, chunk: Chunk) -> None:
        """Read past what is left of the payload and check the chunk's crc."""
        what = f"the payload of chunk {chunk.type.decode()}"
        left = chunk.start + chunk.length - self.offset
        while left > 0:
            left -= len(self.payload(min(left, PIECE), what))
        offset = self.offset
        (declared,) = struct.unpack("<I", self._take(4, f"the crc of chunk {chunk.type.decode()}"))
        if declared != self._chunk_crc:
            expected = f"crc {self._chunk_crc:08x} of chunk {chunk.type.decode()}"
            refuse(offset, expected, f"{declared:08x}")

    def expect_end(self) -> None:
        """Refuse bytes behind the last chunk."""
        if self._stream.read(1):
            refuse(self.offset, "the end of the file behind IEND", "more bytes")

    def _take(self, count: int, what: str) -> bytes:
        pieces: list[bytes] = []
        have = 0
        while have < count:
            piece = self._stream.read(min(count - have, max(PIECE, have)))
            if not piece:
                refuse(self.offset + have, f"{count - have} more bytes of {what}", "the end")
            pieces.append(piece)
            have += len(piece)
        data = pieces[0] if len(pieces) == 1 else b"".join(pieces)
        self.offset += count
        self._running_crc = zlib.crc32(data, self._running_crc)
        return data


class ChunkWriter:
    """Writes the magic and then chunks, keeping count and crc of all bytes written."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self.file_crc = 0
        self.file_bytes = 0
        self._write(MAGIC)

    def chunk(self, type_: bytes, payload: bytes) -> None:
        """Write one chunk; MapFileError where the payload is longer than 32 bits can say."""
        if len(payload) > MAX_PAYLOAD:
            raise MapFileError(
                f"a map chunk of {len(payload)} bytes is more than a .bsm can hold:"
                " write fewer or coarser levels, or compress"
            )
        crc = zlib.crc32(payload, zlib.crc32(type_))
        self._write(struct.pack("<I4s", len(payload), type_))
        self._write(payload)
        self._write(struct.pack("<I", crc))

    def _write(self, data: bytes) -> None:
        self._stream.write(data)
        self.file_bytes += len(data)
        self.file_crc = zlib.crc32(data, self.file_crc)
