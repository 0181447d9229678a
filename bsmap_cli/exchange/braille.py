"""A small picture of a map in braille letters, for terminals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bsmap_cli.mapping.map_document import MapLevel
from bsmap_cli.mapping.sampling import sample_level

DOTS_ACROSS, DOTS_DOWN = 2, 4  # of one letter
# the bit of each dot of a letter, row by row
BITS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], np.uint8)
FIRST_LETTER = 0x2800


@dataclass(frozen=True, slots=True)
class BraillePicture:
    """Lines of braille letters, none where nothing is drawn; letter_m : width of a letter [m]."""

    lines: list[str]
    letter_m: float


def braille_map(levels: Sequence[MapLevel], *, columns: int = 60, rows: int = 24) -> BraillePicture:
    """Lines of at most `columns` letters, `rows` of them at most.

    A dot is set where a curve passes; both axes have one scale (letters are twice as high as
    wide), y points up.
    """
    points = np.concatenate(
        [np.zeros((0, 2)), *(sample_level(level, level.knot_step_m).points for level in levels)]
    )
    if not len(points):
        return BraillePicture([], 0.0)
    low, high = points.min(axis=0), points.max(axis=0)
    across, down = columns * DOTS_ACROSS, rows * DOTS_DOWN
    dot_m = max((high[0] - low[0]) / (across - 1), (high[1] - low[1]) / (down - 1), 1e-9)
    # closer samples than dots leave no gaps
    fine = [sample_level(level, 0.5 * dot_m).points for level in levels]
    dots = np.rint((np.concatenate(fine) - low) / dot_m).astype(np.int64)
    column, row = np.clip(dots[:, 0], 0, across - 1), np.clip(dots[:, 1], 0, down - 1)
    row = min(int(row.max()), down - 1) - row
    letters = np.zeros((rows, columns), np.uint8)
    bits = BITS[row % DOTS_DOWN, column % DOTS_ACROSS]
    np.bitwise_or.at(letters, (row // DOTS_DOWN, column // DOTS_ACROSS), bits)
    used = letters[: int(row.max()) // DOTS_DOWN + 1]
    lines = ["".join(chr(FIRST_LETTER + int(letter)) for letter in line) for line in used]
    shown = [line.rstrip(chr(FIRST_LETTER)) for line in lines]
    return BraillePicture(shown, DOTS_ACROSS * float(dot_m))
