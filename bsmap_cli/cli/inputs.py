"""Where input comes from: files, or standard input where it is a pipe."""

from __future__ import annotations

import io
import os
import stat
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, BinaryIO

from bsmap_cli.errors import LogError, MapFileError, UsageError

if TYPE_CHECKING:
    from bsmap_cli.mapping.map_document import MapDocument
    from bsmap_cli.mapping.map_file import MapSizes
    from bsmap_cli.sensor.trajectory import Trajectory

STDIN = "-"


def log_sources(logs: Sequence[str] | None) -> tuple[str, ...]:
    """The logs to read: what was named, else standard input where something is piped in."""
    return tuple(logs or ()) or (_piped("LOG"),)


def map_source(path: str | None) -> str:
    """The map to read: what was named, else standard input where something is piped in."""
    return path if path is not None else _piped("MAP")


@contextmanager
def binary_input(path: str) -> Iterator[BinaryIO]:
    """An open file, or standard input for `-`.

    Raises
    ------
    LogError : the file cannot be opened.
    """
    if path == STDIN:
        if sys.stdin is None:
            raise UsageError("standard input is closed: name a file")
        yield sys.stdin.buffer
        return
    try:
        stream = open(path, "rb")  # noqa: SIM115 (closed below; only the opening is guarded)
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}: check the path") from error
    with stream:
        yield stream


@contextmanager
def text_input(path: str) -> Iterator[Iterator[str]]:
    """The lines of a text file, plain or packed, or of standard input for `-`.

    Raises
    ------
    LogError : the file cannot be opened, is damaged or is not text; other errors of reading get
        the name of the file in front.
    """
    from bsmap_cli.logs.byte_streams import DamagedBytesError, unpack

    name = _shown(path)
    with binary_input(path) as stream:
        try:
            yield io.TextIOWrapper(unpack(stream), encoding="utf-8-sig")
        except UnicodeDecodeError as error:
            raise LogError(f"{name} is not a text file (UTF-8): is it the right one?") from error
        except (LogError, DamagedBytesError) as error:
            raise LogError(f"{name}: {error}") from error


def read_trajectory(path: str) -> Trajectory:
    """A trajectory in TUM, CSV or JSON; LogError where it cannot be read or holds no pose."""
    from bsmap_cli.exchange import trajectories

    with text_input(path) as lines:
        trajectory = trajectories.read_trajectory(lines)
    if not len(trajectory):
        raise LogError(f"{_shown(path)} holds no pose: name a trajectory")
    return trajectory


def read_map_file(path: str) -> tuple[MapDocument, MapSizes]:
    """A map, or its twin in JSON, and what its parts take; MapFileError names file and place."""
    from bsmap_cli.logs.byte_streams import put_back
    from bsmap_cli.mapping.map_file import read_map_with_sizes

    with binary_input(path) as stream:
        try:
            first = stream.read(1)
            whole = put_back(first, stream)
            return _read_twin(whole) if first == b"{" else read_map_with_sizes(whole)
        except MapFileError as error:
            raise MapFileError(f"{_shown(path)}: {error}") from error


def _shown(path: str) -> str:
    """What an input is called in a message."""
    return "standard input" if path == STDIN else path


def _read_twin(stream: BinaryIO) -> tuple[MapDocument, MapSizes]:
    """A map in JSON, with the sizes that its map file would have."""
    from bsmap_cli.evaluation.map_statistics import sizes_of
    from bsmap_cli.exchange.map_json import read_map_json

    document = read_map_json(stream)
    return document, sizes_of(document)


def _piped(metavar: str) -> str:
    """`-` where standard input is a pipe, a socket or a redirected file."""
    if sys.stdin is not None:
        mode = os.fstat(sys.stdin.fileno()).st_mode
        if stat.S_ISFIFO(mode) or stat.S_ISREG(mode) or stat.S_ISSOCK(mode):
            return STDIN
    raise UsageError(f"missing {metavar}: name one, or pipe it in")
