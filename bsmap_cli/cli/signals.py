"""Signals that end a run: they become exceptions, so that temporary files go.

A compiler at work may swallow an exception, turn it into another one, or be left in a state that
crashes; there the run ends at once, by hand.
"""

from __future__ import annotations

import os
import signal
import sys
from contextlib import suppress
from pathlib import Path
from types import FrameType
from typing import Any

COMPILERS = ("numba", "llvmlite")
CLEAR_BAR = "\r\x1b[2K\x1b[?25h"  # the line of the progress bar, and the cursor it hid

unfinished: set[Path] = set()
"""Temporary files of this run: removed where it ends without unwinding."""

_arrived: list[int] = []


def catch_signals() -> None:
    """Turn Ctrl-C, SIGTERM and SIGHUP into exceptions, where nobody chose to ignore them."""
    defaults = {
        "SIGINT": signal.default_int_handler,
        "SIGTERM": signal.SIG_DFL,
        "SIGHUP": signal.SIG_DFL,
    }
    for name, default in defaults.items():
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) == default:
            signal.signal(number, _leave)
    sys.unraisablehook = _unraisable


def end_if_asked() -> None:
    """Raise what a signal raised before, should that have been swallowed."""
    if _arrived:
        _raise(_arrived[0])


def ending_signal() -> int | None:
    """The signal that ends this run, if there was one."""
    return _arrived[0] if _arrived else None


def _leave(number: int, frame: FrameType | None) -> None:
    if _in_compiler(frame):
        _end_at_once(number)
    _arrived.append(number)
    _raise(number)


def _raise(number: int) -> None:
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    raise SystemExit(128 + number)


def _in_compiler(frame: FrameType | None) -> bool:
    while frame is not None:
        if str(frame.f_globals.get("__name__", "")).split(".")[0] in COMPILERS:
            return True
        frame = frame.f_back
    return False


def _end_at_once(number: int) -> None:
    """Leave without unwinding the compiler's frames."""
    for part in list(unfinished):
        with suppress(OSError):
            part.unlink()
    with suppress(OSError, ValueError):
        if sys.stderr is not None:
            clear = CLEAR_BAR if sys.stderr.isatty() else ""
            os.write(sys.stderr.fileno(), f"{clear}error: interrupted\n".encode())
    os._exit(128 + number)


def _unraisable(problem: Any) -> None:
    """What goes wrong while the run is being ended is not worth a word."""
    error: BaseException | None = problem.exc_value
    if not _arrived and not isinstance(error, BrokenPipeError):
        sys.__unraisablehook__(problem)
