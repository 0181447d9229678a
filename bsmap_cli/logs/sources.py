"""Where a log comes from: files, folders of parts, ROS 2 bag directories, streams."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from bsmap_cli.errors import LogError, UsageError
from bsmap_cli.logs.byte_streams import is_packed, put_back, unpack

STDIN = "-"
METADATA_FILE = "metadata.yaml"
_METADATA_LIMIT_BYTES = 1 << 20


@dataclass(slots=True)
class Source:
    """One file or stream of a log.

    name : for messages to the user.
    path : the file, or None for a stream.
    found : whether the source was come upon in a folder rather than named by the user.
    lacks : parts of the same folder that a `metadata.yaml` or a link names and that are not there.
    ours : the stream below `stream` that was opened here, to be closed here.
    """

    name: str
    path: Path | None = None
    stream: BinaryIO | None = None
    found: bool = False
    ours: BinaryIO | None = None
    lacks: tuple[str, ...] = ()
    _front: bytes = b""

    @contextmanager
    def open(self) -> Iterator[BinaryIO]:
        """The bytes from the start, unpacked; a stream can be opened once (see `put_back`)."""
        if self.path is None:
            assert self.stream is not None
            yield unpack(put_back(self._front, self.stream))
            return
        with open_file(self.path) as file:
            yield unpack(file)

    @property
    def plain_path(self) -> Path | None:
        """The file, where its bytes are the log's own and not compressed."""
        if self.path is None:
            return None
        with open_file(self.path) as file:
            return None if is_packed(file.read(4)) else self.path

    def close(self) -> None:
        """Close a stream that was opened here."""
        if self.ours is not None:
            self.ours.close()

    def keep(self, front: bytes, rest: BinaryIO) -> None:
        """Remember bytes that were read from a stream to look at them."""
        if self.path is None:
            self._front, self.stream = front, rest


@contextmanager
def open_file(path: Path) -> Iterator[BinaryIO]:
    """The file, closed behind the block; raises LogError where it cannot be opened."""
    with _opened(path) as file:
        yield file


def _opened(path: Path) -> BinaryIO:
    try:
        return path.open("rb")
    except OSError as error:
        raise LogError(f"cannot open {path}: {error.strerror or error}") from error


def natural_key(text: str) -> list[tuple[int, int, str]]:
    """Sort key that puts `part_2` before `part_10`."""
    pieces = re.split(r"([0-9]+)", text)
    return [(0, int(piece), "") if piece.isdecimal() else (1, 0, piece) for piece in pieces]


def expand(sources: Sequence[str | Path | BinaryIO]) -> list[Source]:
    """The files and streams behind what the user named, in natural order.

    "-" is standard input. Raises LogError for a name that is not there.
    """
    named = [_as_source(source) for source in sources]
    if any(source.path is None for source in named):
        if len(named) > 1:
            for source in named:
                source.close()
            raise UsageError("a stream cannot be joined with other logs: give one or the other")
        return named
    named.sort(key=lambda source: natural_key(str(source.path)))
    return [part for source in named for part in _parts(source)]


def _as_source(source: str | Path | BinaryIO) -> Source:
    if source == STDIN:
        return Source(name="standard input", stream=sys.stdin.buffer)
    if isinstance(source, str | Path):
        path = Path(source)
        if path.is_fifo() or path.is_char_device():  # it can be opened once only
            stream = _opened(path)
            return Source(name=str(path), stream=stream, ours=stream)
        return Source(name=path.name or str(path), path=path)
    return Source(name=str(getattr(source, "name", "stream")), stream=source)


def _parts(source: Source) -> list[Source]:
    path = source.path
    assert path is not None
    try:
        if not path.is_dir():
            if not path.exists():
                raise LogError(f"{path} does not exist")
            return [source]
        children = sorted(
            (child for child in path.iterdir() if not child.name.startswith(".")),
            key=lambda child: natural_key(child.name),
        )
    except OSError as error:
        raise LogError(f"cannot open {path}: {error.strerror or error}") from error
    # a pipe or a socket in a folder is nobody's log, and would be waited for
    special = [child for child in children if child.exists() and not _holds_data(child)]
    children = [child for child in children if child not in special]
    dangling = tuple(child.name for child in children if not child.exists())
    children = [child for child in children if child.name not in dangling]
    if not children:
        raise LogError(f"{path} is a folder without a log: name a log")
    lacks = dangling + _missing_parts(path, [child.name for child in children])
    folder = path.name or path.resolve().name
    return [
        part
        for child in children
        for part in _parts(
            Source(name=f"{folder}/{child.name}", path=child, found=True, lacks=lacks)
        )
    ]


def _missing_parts(folder: Path, names: list[str]) -> tuple[str, ...]:
    """The parts of a bag that are not in its folder, packed or not."""
    if not _is_bag_folder(folder):
        return ()
    with _opened(folder / METADATA_FILE) as file:
        text = file.read(_METADATA_LIMIT_BYTES).decode("utf-8", "replace")
    listed = re.search(r"^ *relative_file_paths:[ ]*\n((?:[ ]*- .*\n)*)", text, re.MULTILINE)
    parts = re.findall(r"- *[\"']?([^\"'\n]+)", listed[1]) if listed else []
    return tuple(part for part in parts if not any(name.startswith(part) for name in names))


def _holds_data(path: Path) -> bool:
    return path.is_file() or (path.is_dir() and _is_bag_folder(path))


def _is_bag_folder(path: Path) -> bool:
    return (path / METADATA_FILE).is_file()
