"""The progress bar on standard error, where that is a terminal."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import TYPE_CHECKING

from bsmap_cli.cli.compiled_code import compiled_note
from bsmap_cli.cli.signals import end_if_asked
from bsmap_cli.cli.talk import Talk, is_terminal
from bsmap_cli.pipeline import Silent

if TYPE_CHECKING:
    from rich.progress import Progress as RichProgress
    from rich.progress import TaskID

SHORTEST_REFRESH_S = 0.1
SLOW_START_S = 3.0
STARTING = "starting (the first run compiles)"


@contextmanager
def progress_bar(
    talk: Talk, *, started: Callable[[], None], total: int | None = None
) -> Iterator[Silent]:
    """A bar for the length of the block; silent with --quiet and where nobody looks.

    started : called once, when the first scan is through.
    """
    if talk.level < 0 or not is_terminal(sys.stderr) or os.environ.get("TERM") == "dumb":
        yield _Plain(talk, started)
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TextColumn("{task.fields[figures]}"),
        TimeElapsedColumn(),
    )
    console = Console(stderr=True, no_color=not talk.colored(sys.stderr), highlight=False)
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task(STARTING, total=total, figures="")
        yield _Bar(talk, started, bar, task)


class _Plain(Silent):
    """No bar; only says what was chosen, and why the first scan took so long."""

    def __init__(self, talk: Talk, started: Callable[[], None]) -> None:
        self._talk = talk
        self._tell_start = started
        self._began = perf_counter()
        self._started = False

    def scans(self, count: int, span_s: float) -> None:
        """A scan is through."""
        end_if_asked()
        if not self._started:
            self._started = True
            self._tell_start()
            waited_s = perf_counter() - self._began
            if waited_s > SLOW_START_S and _has_compiled():
                self._talk.note(compiled_note(waited_s))
            self._began = perf_counter()

    def stage(self, name: str) -> None:
        """What took time before the first scan was not the compiler."""
        if not self._started:
            self._began = perf_counter()


def _has_compiled() -> bool:
    """Whether it was the compiler that took the time: a slow pipe or disk takes some, too."""
    from bsmap_cli.pipeline.compile_ahead import freshly_compiled

    return bool(freshly_compiled())


class _Bar(_Plain):
    def __init__(
        self, talk: Talk, started: Callable[[], None], bar: RichProgress, task: TaskID
    ) -> None:
        super().__init__(talk, started)
        self._bar = bar
        self._task = task
        self._shown = 0.0

    def scans(self, count: int, span_s: float) -> None:
        """Show scans/s and times real time, a few times a second."""
        super().scans(count, span_s)
        now = perf_counter()
        if now - self._shown < SHORTEST_REFRESH_S:
            return
        self._shown = now
        elapsed_s = max(now - self._began, 1e-9)
        rate, pace = count / elapsed_s, span_s / elapsed_s
        figures = f"{count} scans  {rate:.0f} scans/s  {pace:.0f} x real time"
        self._bar.update(self._task, description="scans", completed=count, figures=figures)
        self._bar.refresh()  # a short run shows them, too

    def stage(self, name: str) -> None:
        """Another task; after the scans of unknown length."""
        super().stage(name)
        if self._started:
            self._bar.update(self._task, total=None, figures="")
        self._bar.update(self._task, description=name)
