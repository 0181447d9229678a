"""Signals that end a run: they become exceptions, so that temporary files go.

A compiler at work may swallow the exception of Ctrl-C, or turn it into another one; the signal
is remembered, so that the run ends at the next scan all the same.
"""

from __future__ import annotations

import signal
import sys
from types import FrameType
from typing import Any

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


def _leave(number: int, _frame: FrameType | None) -> None:
    _arrived.append(number)
    _raise(number)


def _raise(number: int) -> None:
    if number == signal.SIGINT:
        raise KeyboardInterrupt
    raise SystemExit(128 + number)


def _unraisable(problem: Any) -> None:
    """What goes wrong while the run is being ended is not worth a word."""
    error: BaseException | None = problem.exc_value
    if not _arrived and not isinstance(error, BrokenPipeError):
        sys.__unraisablehook__(problem)
