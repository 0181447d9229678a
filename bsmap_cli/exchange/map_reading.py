"""Maps from files of either kind, known from their content: `.bsm`, or its twin in JSON."""

from __future__ import annotations

from typing import BinaryIO, cast

from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.map_file import MapSizes, read_map_with_sizes


class _Peeked:
    """A stream that has given up its first bytes already, and gives them again."""

    def __init__(self, start: bytes, rest: BinaryIO) -> None:
        self._start = start
        self._rest = rest

    def read(self, size: int = -1) -> bytes:
        """At most `size` bytes, or all."""
        if size < 0:
            data, self._start = self._start + self._rest.read(), b""
            return data
        if not self._start:
            return self._rest.read(size)
        piece, self._start = self._start[:size], self._start[size:]
        return piece


def read_any_map(stream: BinaryIO) -> tuple[MapDocument, MapSizes]:
    """The map and the bytes its parts take; of a map in JSON those it would take as `.bsm`.

    The stream need not be seekable. MapFileError where it holds neither.
    """
    start = stream.read(1)
    whole = cast(BinaryIO, _Peeked(start, stream))
    if start != b"{":
        return read_map_with_sizes(whole)
    from bsmap_cli.evaluation.map_statistics import sizes_of
    from bsmap_cli.exchange.map_json import read_map_json

    document = read_map_json(whole)
    return document, sizes_of(document)
