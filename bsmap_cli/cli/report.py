"""Reports on standard output: one JSON document, or lines a person reads."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable
from typing import Any
from unicodedata import combining, east_asian_width

from bsmap_cli.cli.talk import BOLD, Talk, harmless
from bsmap_cli.errors import UsageError


def print_json(document: Any) -> None:
    """One document, keys in the order of the report; what is not finite becomes null."""
    text = json.dumps(_json_value(document), indent=2, ensure_ascii=False, allow_nan=False)
    print_text(text + "\n")


def print_rows(rows: Iterable[tuple[str, str]], talk: Talk) -> None:
    """`name   value` lines, the values in one column."""
    rows = [(_cell(name), _cell(value)) for name, value in rows]
    width = max((_width(name) for name, _ in rows), default=0)
    for name, value in rows:
        shown = talk.paint(_filled(name, width), BOLD, sys.stdout)
        print_text(f"{shown}  {value}".rstrip() + "\n")


def print_table(header: tuple[str, ...], rows: Iterable[tuple[str, ...]], talk: Talk) -> None:
    """A table with a header; columns as wide as their widest cell."""
    lines = [header, *(tuple(map(_cell, row)) for row in rows)]
    widths = [max(_width(line[column]) for line in lines) for column in range(len(header))]
    for number, line in enumerate(lines):
        text = "  ".join(map(_filled, line, widths))
        text = text.rstrip()
        print_text((talk.paint(text, BOLD, sys.stdout) if number == 0 else text) + "\n")


def _cell(text: str) -> str:
    """Text of one line that steers no terminal."""
    return harmless(text).replace("\n", "\\n").replace("\t", "\\t")


def _width(text: str) -> int:
    """Columns that a terminal needs: two for a wide letter, none for a mark over another."""
    if text.isascii():
        return len(text)
    wide = sum(east_asian_width(letter) in "WF" for letter in text)
    return len(text) + wide - sum(combining(letter) > 0 for letter in text)


def _filled(text: str, width: int) -> str:
    return text + " " * (width - _width(text))


def print_text(text: str) -> None:
    """Text on standard output."""
    if sys.stdout is None:
        raise UsageError("standard output is closed: there is nowhere to print")
    sys.stdout.write(text)


def size(count: float) -> str:
    """A number of bytes as a person reads it."""
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000
    return f"{count:.1f} GB"


def _json_value(value: Any) -> Any:
    """Plain JSON: numpy scalars become numbers, tuples lists."""
    if isinstance(value, dict):
        return {str(key): _json_value(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(entry) for entry in value]
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
