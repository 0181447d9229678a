"""Tables as Markdown, on stdout and in the pages that show them.

A page holds each table between `<!-- NAME: COMMAND -->` and `<!-- end of NAME -->`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path


def markdown(names: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """A table; rows are printed as they come, since each may take its time."""
    head = list(names)
    lines = [_line(head), _line(["---"] * len(head))]
    print("\n" + "\n".join(lines), flush=True)
    for row in rows:
        lines.append(_line(row))
        print(lines[-1], flush=True)
    return "\n".join(lines) + "\n"


def write_table(page: Path, name: str, table: str) -> None:
    """Put a table in its place on a page.

    Raises ValueError where the page has no such place.
    """
    text = page.read_text(encoding="utf-8")
    place = re.compile(rf"(<!-- {name}: [^>]*-->\n).*?(<!-- end of {name} -->)", re.DOTALL)
    if not place.search(text):
        raise ValueError(f"{page} has no place for the table '{name}'")
    text = place.sub(lambda found: f"{found[1]}{table}{found[2]}", text)
    page.write_text(text, encoding="utf-8", newline="\n")


def length(metres: float) -> str:
    """In millimetres or metres, whichever reads better."""
    return f"{1e3 * metres:.3g} mm" if metres < 1.0 else f"{metres:.1f} m"


def _line(cells: Iterable[object]) -> str:
    return "| " + " | ".join(str(cell) for cell in cells) + " |"
