"""Bounds for blocks of poses in a search: heights above those of the likelihood, and coarser."""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.geometry.compiled import lean, lean_part
from bsmap_cli.slam.correlative import Integers
from bsmap_cli.slam.likelihood import CHANNELS, Grid

FINEST = 3  # height of the finest blocks that span angles
PAD = 5  # entries of a coarse level before the first cell: as many as one of its windows spans


def coarse_levels(windows: Grid, top: int) -> tuple[Integers, Grid]:
    """Bounds for blocks of heights FINEST .. top, from the largest values in windows of 8 cells.

    Entry i of height h belongs to the cells from (i - PAD) 2^(h-1) on, 5 * 2^(h-1) of them:
    wherever within 2^(h-1) cells a window of 2^(h+1) begins, the entry holds its largest value.
    The heights lie one after the other in one array; the table has first entry, rows and columns.
    """
    side = 1 << (FINEST - 1)
    _, rows, columns = windows.shape
    level = np.zeros((CHANNELS, -(-rows // side) + PAD, -(-columns // side) + PAD), np.uint8)
    _finest_level(windows, side, level)
    levels = [level]
    for _ in range(FINEST, top):
        rows, columns = (-(-(size - PAD) // 2) + PAD for size in level.shape[1:])
        level = np.zeros((CHANNELS, rows, columns), np.uint8)
        _next_level(levels[-1], level)
        levels.append(level)
    starts = np.cumsum([0, *(level.size for level in levels[:-1])])
    table = [(start, *level.shape[1:]) for start, level in zip(starts, levels, strict=True)]
    return np.array(table, np.int64), np.concatenate([level.ravel() for level in levels])


@lean
def _finest_level(windows: Grid, side: int, level: Grid) -> None:
    _, rows, columns = windows.shape
    for k in range(CHANNELS):
        for i in range(level.shape[1]):
            for j in range(level.shape[2]):
                value = 0
                for a in range(4):  # windows of 8 cells, 4 apart, span 20
                    r = (i - PAD + a) * side
                    for b in range(4):
                        c = (j - PAD + b) * side
                        if 0 <= r < rows and 0 <= c < columns:
                            value = max(value, int(windows[k, r, c]))
                level[k, i, j] = value


@lean
def _next_level(level: Grid, wider: Grid) -> None:
    _, rows, columns = level.shape
    for k in range(CHANNELS):
        for i in range(wider.shape[1]):
            for j in range(wider.shape[2]):
                value = 0
                for a in range(2):
                    r = 2 * (i - PAD) + PAD * a + PAD
                    for b in range(2):
                        c = 2 * (j - PAD) + PAD * b + PAD
                        if 0 <= r < rows and 0 <= c < columns:
                            value = max(value, int(level[k, r, c]))
                wider[k, i, j] = value


@lean_part
def bound(
    table: Integers, bounds: Grid, height: int, cells: Integers, dx: int, dy: int, best: float
) -> float:
    """What no pose of a block of this height can score more than; some less where below `best`."""
    start, rows, columns = table[height - FINEST]
    total, least = 0, math.floor(255.0 * len(cells) * (best - 1.0))
    for j in range(len(cells)):
        if total < least:
            break
        least += 255
        c = (cells[j, 0] + dx >> height - 1) + PAD
        r = (cells[j, 1] + dy >> height - 1) + PAD
        if 0 <= c < columns and 0 <= r < rows:
            value = 0
            for k in range(cells[j, 2], cells[j, 3] + 1):
                value = max(value, int(bounds[start + ((k & 3) * rows + r) * columns + c]))
            total += value
    return total / (255.0 * len(cells))
