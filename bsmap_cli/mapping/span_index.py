"""The spans of a map level, found by where they are: a hash of square cells.

A cell is one knot step wide and holds the spans whose middle lies in it, as a linked list, so
that a changed curve re-enters only its changed spans. A span is at most about one knot step
long: the 3 x 3 cells round a point hold every span within half a knot step of it.
"""

from __future__ import annotations

import math

from bsmap_cli.geometry.compiled import inlined, lean_part
from bsmap_cli.mapping.level_arrays import LevelArrays

EMPTY = -(2**62)


@inlined
def cell_key(column: int, row: int) -> int:
    """One integer for a cell."""
    return (column << 31) ^ (row & 0x7FFFFFFF)


@inlined
def find_slot(level: LevelArrays, key: int) -> int:
    """Slot of a cell in the hash, or the free slot where it belongs."""
    mask = len(level.cell_keys) - 1
    mixed = key * 0x9E3779B97F4A7
    slot = (mixed ^ mixed >> 32) & mask  # the high bits alone know of column and row
    while level.cell_keys[slot] != key and level.cell_keys[slot] != EMPTY:
        slot = (slot + 1) & mask
    return slot


@inlined
def remove_span(level: LevelArrays, row: int) -> None:
    """Take a span out of its cell; nothing happens where it is in none."""
    slot = level.span_cell[row]
    if slot < 0:
        return
    if level.cell_heads[slot] == row:
        level.cell_heads[slot] = level.next_span[row]
    else:
        other = level.cell_heads[slot]
        while level.next_span[other] != row:
            other = level.next_span[other]
        level.next_span[other] = level.next_span[row]
    level.span_cell[row] = -1


@lean_part
def insert_span(level: LevelArrays, row: int, knot_step_m: float) -> None:
    """Put a span into the cell of its middle, leaving the one it was in."""
    column = math.floor(level.spans[row, 0] / knot_step_m)
    line = math.floor(level.spans[row, 1] / knot_step_m)
    key = cell_key(column, line)
    slot = find_slot(level, key)
    if level.span_cell[row] == slot and level.cell_keys[slot] == key:
        return
    remove_span(level, row)
    if level.cell_keys[slot] == EMPTY:
        level.cell_keys[slot] = key
        level.cell_heads[slot] = -1
        level.sizes[2] += 1
    level.next_span[row] = level.cell_heads[slot]
    level.cell_heads[slot] = row
    level.span_cell[row] = slot


@inlined
def nearest_span(
    level: LevelArrays,
    knot_step_m: float,
    px: float,
    py: float,
    tx: float,
    ty: float,
    gate_m: float,
    min_cosine: float,
) -> tuple[int, float]:
    """The span nearest to (px, py) that runs along (tx, ty), and f on it; row -1 if none.

    Distance is measured to the chord of the span. A span that runs the other way is the far side
    of a thin wall and never a match.
    """
    column = math.floor(px / knot_step_m)
    line = math.floor(py / knot_step_m)
    best_row = -1
    best_f = 0.0
    best = gate_m * gate_m
    for i in range(column - 1, column + 2):
        for j in range(line - 1, line + 2):
            slot = find_slot(level, cell_key(i, j))
            if level.cell_keys[slot] == EMPTY:
                continue
            row = level.cell_heads[slot]
            while row >= 0:
                hx, hy = level.spans[row, 2], level.spans[row, 3]
                half2 = hx * hx + hy * hy + 1e-300
                along = hx * tx + hy * ty
                if along > 0.0 and along * along > min_cosine * min_cosine * half2:
                    dx, dy = px - level.spans[row, 0], py - level.spans[row, 1]
                    s = (dx * hx + dy * hy) / half2
                    s = min(1.0, max(-1.0, s))
                    ex, ey = dx - s * hx, dy - s * hy
                    distance2 = ex * ex + ey * ey
                    if distance2 < best:
                        best = distance2
                        best_row = row
                        best_f = 0.5 * (s + 1.0)
                row = level.next_span[row]
    return best_row, best_f
