"""What was lost on the way, and what that does to the exit code."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bsmap_cli.cli.door import DONE, LOSSES
from bsmap_cli.cli.talk import Talk
from bsmap_cli.errors import LogError
from bsmap_cli.logs.finding import counted

if TYPE_CHECKING:
    from bsmap_cli.logs.reader import ReadReport


def tell_warnings(report: ReadReport, talk: Talk, *, found: bool = True) -> None:
    """Say what the reader found worth a word; `found`: also what `check` has a finding of."""
    said = () if found else {line for lines in report.found.values() for line in lines}
    for warning in report.warnings:
        if warning not in said:
            talk.warn(warning)


def reading_losses(report: ReadReport) -> tuple[str, ...]:
    """One line each for what could not be read."""
    losses = []
    if report.scans_skipped:
        losses.append(f"{counted(report.scans_skipped, 'scan')} could not be read")
    if report.truncated:
        losses.append("part of the log is missing or damaged; what it holds was used")
    return tuple(losses)


def exit_code(losses: Sequence[str], *, strict: bool, talk: Talk) -> int:
    """0, or 3 with the losses on standard error.

    Raises
    ------
    LogError : something was lost and the user wants all or nothing.
    """
    if not losses:
        return DONE
    if strict:
        raise LogError(f"{'; '.join(losses)}; nothing is written because of --strict")
    for loss in losses:
        talk.warn(loss)
    return LOSSES
