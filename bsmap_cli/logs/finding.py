"""One thing that is wrong with a log, or worth to know, and what to do about it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Level = Literal["problem", "warning", "note"]
LEVELS: tuple[Level, ...] = ("problem", "warning", "note")
OFTEN_SHARE = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """What a check found.

    name : "gaps", "stamps", ... for programs. level : "problem" where mapping will suffer,
    "warning" where it may, "note" otherwise. remedy : what to do about it.
    value : the measure behind it, in the unit that the message names.
    """

    name: str
    level: Level
    message: str
    remedy: str
    value: float


def worse_if(bad: bool) -> Level:
    """A problem, or else a warning."""
    return "problem" if bad else "warning"


def counted(number: int, what: str) -> str:
    """`1 scan`, `2 scans`."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"
