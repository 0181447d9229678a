"""The one place where errors become a line and an exit code.

Exit codes: 0 done; 1 could not; 2 usage or settings; 3 done, but something was lost;
130 interrupted; 143 and 129 ended by SIGTERM and SIGHUP.
"""

from __future__ import annotations

import gc
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from typing import Any

import typer

from bsmap_cli.cli.signals import catch_signals, ending_signal
from bsmap_cli.cli.talk import Talk
from bsmap_cli.errors import BsmapError, ConfigError, UsageError

DONE, COULD_NOT, USAGE, LOSSES, INTERRUPTED = 0, 1, 2, 3, 130

YOUNG_OBJECTS = 50_000
"""Before a search for cycles among them: numba makes millions, and keeps them."""

# The parser's own usage errors; their class has no public name.
ParserError: type[Exception] = typer.BadParameter.__mro__[1]


def run(arguments: Sequence[str]) -> int:
    """Parse the arguments, run the command and return the exit code; standard output is flushed."""
    from bsmap_cli.cli.app import build_app

    catch_signals()
    collect_seldom()
    code = guarded(lambda: build_app(arguments)(list(arguments), "bsmap", standalone_mode=False))
    flushed = guarded(_flush_output)
    return code or flushed


def collect_seldom() -> None:
    """Let Python seldom look for cycles: numba keeps its own, scans and maps hold none."""
    gc.set_threshold(YOUNG_OBJECTS, 50, 50)


def guarded(action: Callable[[], Any], talk: Talk | None = None) -> int:
    """Run an action; whatever goes wrong becomes one line and an exit code."""
    talk = talk or Talk()
    try:
        value = action()
        return value if isinstance(value, int) else DONE
    except (BrokenPipeError, SystemExit) as end:
        if _pipe_was_closed(end):
            _discard_output()
            return DONE
        return _ended(end, talk)
    except (KeyboardInterrupt, Exception) as error:
        return _ended(error, talk)


def _ended(error: BaseException, talk: Talk) -> int:
    """Say why the run ends; its exit code."""
    number = ending_signal()
    # Ctrl-C in the middle of a compilation may come out as any fault
    if number is not None or isinstance(error, KeyboardInterrupt):
        talk.error("interrupted")
        return INTERRUPTED if number is None else 128 + number
    if isinstance(error, SystemExit):
        return error.code if isinstance(error.code, int) else COULD_NOT
    if talk.level >= 2:
        traceback.print_exception(error)
    talk.error(_one_line(error))
    usage = isinstance(error, UsageError | ConfigError | ParserError)
    return USAGE if usage else COULD_NOT


def _one_line(error: BaseException) -> str:
    """What is wrong and what to do next, on one line."""
    if isinstance(error, BsmapError):
        text = str(error)
    elif isinstance(error, ParserError):
        text = _parser_message(error)
    elif isinstance(error, OSError) and error.strerror:
        text = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
        text += _remedy(error)
    elif isinstance(error, MemoryError):
        text = "out of memory: read less with --every or --duration, or set a coarser ladder"
    else:
        what = f"{type(error).__name__}: {error}"
        text = f"this should not have happened ({what}): please report it with the output of -vv"
    return " ".join(text.split())


def _parser_message(error: Any) -> str:
    context = getattr(error, "ctx", None)
    path = context.command_path if context else "bsmap"
    text = error.format_message().rstrip(".").replace(": Value error, ", ": ")
    return f"{text}; see `{path} --help`"


def _remedy(error: OSError) -> str:
    import errno

    elsewhere = "write elsewhere with --output"
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        if error.filename:
            return f": make room, or {elsewhere}"
        return ": make room for output, temporary files (TMPDIR) and code (NUMBA_CACHE_DIR)"
    return f": {elsewhere}" if error.errno in (errno.EROFS, errno.EFBIG) else ""


def _pipe_was_closed(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, BrokenPipeError):
            return True
        error = error.__cause__ or error.__context__
    return False


def _flush_output() -> None:
    if sys.stdout is not None and not sys.stdout.closed:
        sys.stdout.flush()


def _discard_output() -> None:
    """The reader has gone: what is still buffered goes nowhere, and without a word."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.__stdout__, sys.__stderr__):
        if stream is None:
            continue
        try:
            stream.flush()
        except BrokenPipeError:
            os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
