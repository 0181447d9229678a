"""A second process for work that needs only messages of the first, and answers with messages.

Python runs one thread at a time, so that a thread would not do. The process is forked: it has at
once all that is loaded, compiled and read. Other systems than Linux cannot promise that this is
safe.
"""

from __future__ import annotations

import os
import signal
import sys
import warnings
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
from numpy.typing import NDArray

CAN_FORK = sys.platform == "linux"
HEARD = {getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)}


def usable_cores() -> int:
    """How many cores this process may run on."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


class Beside:
    """Calls `work(pipe, *arguments)` in a process beside this one.

    pipe : carries messages both ways; it is at its end where the other process is.

    Raises
    ------
    OSError : there is no process to be had.
    """

    def __init__(self, work: Callable[..., None], *arguments: Any) -> None:
        if not CAN_FORK:
            raise OSError("a process cannot be forked safely here")
        context = get_context("fork")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(
            target=_run, args=(self.pipe, theirs, work, arguments), daemon=True
        )
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, HEARD)
        try:
            with warnings.catch_warnings():
                # threads that numpy or a progress bar have started hold nothing that is needed
                warnings.simplefilter("ignore", DeprecationWarning)
                self.process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, blocked)
            theirs.close()

    def send(self, message: bytes | memoryview) -> None:
        """Send a message; waits while many are on the way. None hears it where it has ended."""
        with suppress(OSError):
            self.pipe.send_bytes(message)

    def end(self) -> None:
        """End the other process, whatever it does."""
        self.pipe.close()
        self.process.terminate()
        self.process.join()


def halves(work: Callable[[int, int], NDArray[Any]], count: int) -> NDArray[Any]:
    """`work(0, count)`: rows for so many things, half of them made in a process beside this one.

    Where that one comes to grief, or there is none to be had, all of them are made here.
    """
    middle = count // 2
    try:
        other = Beside(_send_rows, work, middle, count)
    except OSError:
        return work(0, count)
    try:
        rows = [work(0, middle)]
        try:
            rows.append(other.pipe.recv())
        except (OSError, EOFError):
            rows.append(work(middle, count))
        return np.concatenate(rows)
    finally:
        other.end()


def _send_rows(
    pipe: Connection, work: Callable[[int, int], NDArray[Any]], begin: int, end: int
) -> None:
    pipe.send(work(begin, end))


def _run(
    of_the_other: Connection,
    pipe: Connection,
    work: Callable[..., None],
    arguments: tuple[Any, ...],
) -> None:
    """Work, and end without a word where that fails: the other process sees that, and tells."""
    of_the_other.close()  # or its end would never be seen
    for number in HEARD:  # Ctrl-C is for the other process, which ends this one
        signal.signal(number, signal.SIG_IGN if number == signal.SIGINT else signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, HEARD)
    with suppress(Exception):
        work(pipe, *arguments)
