"""What is said on standard error: notes, warnings, errors; results go to standard output."""

from __future__ import annotations

import os
import re
import sys
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, TextIO

ColorMode = Literal["auto", "always", "never"]

BOLD, RED, YELLOW, DIM = "1", "31", "33", "2"


@dataclass(frozen=True, slots=True, kw_only=True)
class Talk:
    """How much is said, and in which colors.

    level : -1 errors and losses only, 0 notes too, 1 details too, 2 tracebacks and debug lines.
    """

    level: int = 0
    color: ColorMode = "auto"

    def note(self, text: str) -> None:
        """What was chosen for the user, and the last line of a run."""
        if self.level >= 0:
            self._say(harmless(text))

    def detail(self, text: str) -> None:
        """What only a curious user wants to know."""
        if self.level >= 1:
            self._say(self.paint(harmless(text), DIM, sys.stderr))

    def warn(self, text: str) -> None:
        """Something the user should look at; the run goes on. Said with --quiet, too."""
        self._say(f"{self.paint('warning:', YELLOW, sys.stderr)} {harmless(text)}")

    def error(self, text: str) -> None:
        """Why the run ends: what is wrong and what to do next."""
        self._say(f"{self.paint('error:', RED, sys.stderr)} {harmless(text)}")

    def paint(self, text: str, code: str, stream: TextIO) -> str:
        """The text in a color where the stream is a terminal that wants it."""
        return f"\033[{code}m{text}\033[0m" if self.colored(stream) else text

    def colored(self, stream: TextIO) -> bool:
        """Whether colors go to this stream: --color, else NO_COLOR, else a real terminal."""
        if self.color != "auto":
            return self.color == "always"
        plain = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
        return not plain and is_terminal(stream)

    def _say(self, text: str) -> None:
        if sys.stderr is None:
            return
        with suppress(OSError):  # nobody listens: no reason to stop the run
            print(text, file=sys.stderr, flush=True)


def harmless(text: str) -> str:
    """Text out of a file without what would steer a terminal."""
    return _STEERING.sub(lambda match: f"\\x{ord(match[0]):02x}", text)


_STEERING = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]")


def is_terminal(stream: TextIO | None) -> bool:
    """Whether a person looks at this stream; a closed one is no terminal."""
    return stream is not None and not stream.closed and stream.isatty()
