"""The settings of every room as one record, and a list of all of them by name."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, is_dataclass
from functools import lru_cache
from typing import Any, get_type_hints

from bsmap_cli.settings import setting
from bsmap_cli.slam.slam_settings import SlamSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings(SlamSettings):
    """Every setting of bsmap: one attribute a section, named as in the settings file."""

    degree: int = setting(3, "degree of the curves", symbol="d", minimum=2, maximum=5)
    ladder: tuple[float, ...] = setting(
        (0.4, 0.2, 0.1), "knot steps of the levels, coarse to fine [m]", symbol="Delta"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Leaf:
    """One setting: its dotted key, its type and what `setting` declared of it."""

    key: str
    type: Any
    meaning: str
    symbol: str
    minimum: float | None
    maximum: float | None
    choices: tuple[str, ...]


@lru_cache(maxsize=1)
def leaves() -> dict[str, Leaf]:
    """Every setting by its dotted key, in the order of the file."""
    return {leaf.key: leaf for leaf in _leaves_of(Settings, "")}


def _leaves_of(owner: type, prefix: str) -> Iterator[Leaf]:
    hints = get_type_hints(owner)
    for entry in fields(owner):
        if is_dataclass(hints[entry.name]):
            yield from _leaves_of(hints[entry.name], f"{prefix}{entry.name}.")
        else:
            yield Leaf(key=prefix + entry.name, type=hints[entry.name], **entry.metadata)
