"""Output files: refused before the work starts, written beside their target, renamed at the end."""

from __future__ import annotations

import io
import os
import stat
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from secrets import token_hex
from types import TracebackType
from typing import TYPE_CHECKING, BinaryIO

from bsmap_cli.cli.formats import TRAJECTORY_FORMATS
from bsmap_cli.cli.signals import end_if_asked, unfinished
from bsmap_cli.cli.talk import is_terminal
from bsmap_cli.errors import BsmapError, UsageError

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

    from bsmap_cli.sensor.trajectory import Trajectory

STDOUT = "-"
POSES_A_PIECE = 10_000


class Outputs:
    """The files of one run: all of them appear when the run ends well, none when it does not.

    with Outputs(force=force, inputs=sources) as outputs:
        target = outputs.add("map.bsm")       # refuses at once what cannot be written
        ...                                    # the work
        write_map(target.open(), document)
    """

    def __init__(self, *, force: bool, inputs: Sequence[str] = ()) -> None:
        self._force = force
        self._inputs = inputs
        self._targets: list[Output] = []

    def add(self, path: str, *, binary: bool = False, stream: bool = False) -> Output:
        """Announce an output; `-` is standard output.

        binary : never shown on a terminal.
        stream : standard output gets bytes as they come, not when the run has ended well.

        Raises
        ------
        UsageError : it exists and --force is not given, it is an input, or it is named twice.
        BsmapError : its folder does not exist or cannot be written.
        """
        target = Output(path, stream=stream)
        if path == STDOUT:
            _check_stdout(binary)
        else:
            self._check_file(target)
        if any(target.same_as(other) for other in self._targets):
            raise UsageError(f"{path} is given as two outputs: give each its own name")
        self._targets.append(target)
        return target

    def _check_file(self, target: Output) -> None:
        final = target.final
        if not target.path:
            raise UsageError("the name of an output is empty: name a file")
        if final.is_dir():
            raise UsageError(f"{target.path} is a folder: name a file in it")
        if not final.parent.is_dir():
            raise BsmapError(f"{target.path}: no folder {final.parent}: make it first")
        for source in self._inputs:
            if source != STDOUT and final.exists() and os.path.samefile(source, final):
                raise UsageError(f"{target.path} is also an input: write to another file")
        if target.direct:
            return
        if final.exists() and not self._force:
            raise UsageError(f"{target.path} exists: replace it with --force, or name another")
        if not os.access(final.parent, os.W_OK | os.X_OK):
            raise BsmapError(f"{target.path}: the folder cannot be written: choose another")

    def __enter__(self) -> Outputs:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if kind is None:
                self._commit()
        finally:
            for target in self._targets:
                target.discard()

    def _commit(self) -> None:
        end_if_asked()
        for target in self._targets:
            target.finish()
        for target in sorted(self._targets, key=lambda target: target.path == STDOUT):
            target.publish()


class Output:
    """One output of a run."""

    def __init__(self, path: str, *, stream: bool) -> None:
        self.path = path
        self.direct = path == STDOUT or _is_special(Path(path))
        # a link stays a link: the file behind it is replaced
        self.final = Path(path) if self.direct else Path(os.path.realpath(path))
        self._stream = stream
        self._file: BinaryIO | None = None
        self._part: Path | None = None

    def same_as(self, other: Output) -> bool:
        """Whether both name one file (standard output counts as one)."""
        if STDOUT in (self.path, other.path):
            return self.path == other.path
        return self.final == other.final and not self.direct

    def open(self) -> BinaryIO:
        """The stream to write to."""
        if self._file is None:
            self._file = self._opened()
        return self._file

    def _opened(self) -> BinaryIO:
        if self.path == STDOUT:
            return sys.stdout.buffer if self._stream else io.BytesIO()
        if self.direct:
            return io.BufferedWriter(_NamedFile(self.final, "wb", self.path))
        self._part = self.final.with_name(f".{self.final.name}.{token_hex(4)}.part")
        unfinished.add(self._part)
        return io.BufferedWriter(_NamedFile(self._part, "xb", self.path))

    def finish(self) -> None:
        """Everything written is on the disk."""
        if self._file is None or self.path == STDOUT:
            return
        self._file.flush()
        if self._part is not None:
            os.fsync(self._file.fileno())
        self._file.close()

    def publish(self) -> None:
        """The output appears under its name."""
        if self._part is not None:
            self._part.replace(self.final)
            self._forget_part()
        elif isinstance(self._file, io.BytesIO):
            sys.stdout.buffer.write(self._file.getbuffer())
            sys.stdout.buffer.flush()

    def discard(self) -> None:
        """Remove what was not published."""
        if self._part is not None:
            self._part.unlink(missing_ok=True)
            self._forget_part()
        if self._file is not None and self.path != STDOUT:
            self._close_quietly()

    def _forget_part(self) -> None:
        if self._part is not None:
            unfinished.discard(self._part)
            self._part = None

    def _close_quietly(self) -> None:
        try:
            if self._file is not None:
                self._file.close()
        except OSError:  # what could not be written was reported when it was written
            pass


def write_trajectory(target: Output, trajectory: Trajectory) -> None:
    """A trajectory in the format of its extension, TUM by default."""
    from bsmap_cli.exchange.trajectories import WRITERS

    kind = TRAJECTORY_FORMATS.get(Path(target.path).suffix.lower(), "tum")
    for piece in _pieces(trajectory) if kind in ("tum", "kitti") else [trajectory]:
        text = io.StringIO()
        WRITERS[kind](text, piece)
        target.open().write(text.getvalue().encode())


def _pieces(trajectory: Trajectory) -> Iterator[Trajectory]:
    """A long trajectory is never held as text."""
    for start in range(0, len(trajectory), POSES_A_PIECE):
        rows = slice(start, start + POSES_A_PIECE)
        yield replace(
            trajectory, stamps_ns=trajectory.stamps_ns[rows], poses=trajectory.poses[rows]
        )


class _NamedFile(io.FileIO):
    """A file whose write errors name the target that the user knows."""

    def __init__(self, path: Path, mode: str, shown: str) -> None:
        super().__init__(path, mode)
        self._shown = shown

    def write(self, data: ReadableBuffer, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            error.filename = self._shown
            raise


def _is_special(path: Path) -> bool:
    """A device or a pipe: written in place."""
    return path.exists() and not stat.S_ISREG(path.stat().st_mode)


def _check_stdout(binary: bool) -> None:
    if sys.stdout is None:
        raise UsageError("standard output is closed: name a file with --output")
    if binary and is_terminal(sys.stdout):
        raise UsageError("binary data does not go to a terminal: name a file, or pipe it on")
