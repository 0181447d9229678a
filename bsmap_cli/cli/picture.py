"""The picture of a map in the terminal."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, TextIO

from bsmap_cli.cli.report import print_text
from bsmap_cli.errors import UsageError

if TYPE_CHECKING:
    from bsmap_cli.mapping.map_document import MapLevel

FEWEST_ROWS = 16
BAR_SHARE = 0.2  # of the picture's width


def can_show(stream: TextIO) -> bool:
    """Whether a terminal is likely to have braille letters."""
    return os.environ.get("TERM") not in ("dumb", "linux") and _encodes(stream)


def print_picture(levels: Sequence[MapLevel], *, beside: int) -> None:
    """Draw the curves as large as the terminal, of which `beside` lines are for other things."""
    from bsmap_cli.exchange.braille import braille_map
    from bsmap_cli.exchange.rounding import round_length

    if sys.stdout is not None and not _encodes(sys.stdout):
        raise UsageError(
            f"standard output is in {sys.stdout.encoding}, which has no braille letters: "
            "set PYTHONIOENCODING=utf-8, or leave out --picture"
        )
    columns, lines = shutil.get_terminal_size()
    rows = max(lines - beside - 3, FEWEST_ROWS)  # scale bar, empty line, prompt
    picture = braille_map(levels, columns=max(columns - 1, 2), rows=rows)
    if not picture.lines:
        return
    width = max(map(len, picture.lines))
    length_m = round_length(max(BAR_SHARE * width, 2.0) * picture.letter_m)
    bar = "\u2500" * max(round(length_m / picture.letter_m) - 2, 0)
    print_text("\n".join(picture.lines) + "\n")
    print_text(f"\u251c{bar}\u2524 {length_m:g} m\n\n")


def _encodes(stream: TextIO) -> bool:
    try:
        "\u28ff\u2500".encode(stream.encoding or "utf-8")
    except (UnicodeEncodeError, LookupError):
        return False
    return True
