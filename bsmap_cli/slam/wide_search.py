"""The same search for wide windows: whole buildings, all round.

Where `correlative.search` asks every block of translations at every angle, here blocks span angles
as well: a block of height h holds 2^h translations each way and 2^h angles, in which no point
moves by more than 2^h - 1 cells, so that windows of 2^(h+1) cells bound them all. Blocks of this
kind are only as fine as 8 cells; from there on each angle is searched by itself.
"""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.geometry.compiled import kernel, lean
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.slam import correlative
from bsmap_cli.slam.correlative import Integers, Peak, Window, descend, project
from bsmap_cli.slam.likelihood import CHANNELS, Grid, Likelihood

FINEST = 3  # height of the finest blocks that span angles
PAD = 5  # entries of a coarse level before the first cell: as many as one of its windows spans
SPREAD = 0.6180339887498949  # the golden section: every stretch of points is asked early on
FEW_BLOCKS = 4096  # so many are asked one by one sooner than blocks of blocks are drawn


def search(
    likelihood: Likelihood,
    points: Points,
    tangents: Points,
    window: Window,
    *,
    floor: float,
    barred: Peak | None = None,
    apart_m: float = 1.0,
    apart_rad: float = 0.17,
) -> Peak | None:
    """`correlative.search`: the same arguments, the same best pose."""
    heights = len(likelihood.grids)
    if len(points) == 0:
        return None
    angles, discs, reach = correlative.window_grid(
        likelihood.cell_m, points, window, barred, apart_m, apart_rad
    )
    block = 1 << (heights - 1)
    blocks = len(angles) * ((2 * reach + block) // block) ** 2
    if heights <= FINEST or blocks <= FEW_BLOCKS:
        return correlative.search(
            likelihood,
            points,
            tangents,
            window,
            floor=floor,
            barred=barred,
            apart_m=apart_m,
            apart_rad=apart_rad,
        )
    order = np.argsort(angles, kind="stable")
    angles, discs = angles[order], discs[order]
    top = max(FINEST + 1, math.ceil(math.log2(max(len(angles), 2 * reach + 1) / 8)))
    cell_m, centre, origin = likelihood.cell_m, window.centre, likelihood.origin_m
    # neighbours are met or missed together: far from one another, few points tell of all
    spread = np.argsort(np.arange(len(points)) * SPREAD % 1.0, kind="stable")
    table, bounds = _coarse_levels(likelihood.grids[FINEST], top)
    found, angle, dx, dy = _search(
        likelihood.grids,
        table,
        bounds,
        points[spread],
        tangents[spread],
        angles,
        np.array([centre[0] - origin[0], centre[1] - origin[1], cell_m, floor]),
        reach,
        discs,
    )
    if found < 0.0:
        return None
    place = np.array([centre[0] + dx * cell_m, centre[1] + dy * cell_m, angles[angle]])
    return Peak(place, found)


def _coarse_levels(windows: Grid, top: int) -> tuple[Integers, Grid]:
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


@lean
def _place(
    points: Points, tangents: Points, angle: float, half_rad: float, frame: Vector, cells: Integers
) -> None:
    """Lowest column and row of each point, and first and last channel, in a range of angles."""
    cos, sin = math.cos(angle), math.sin(angle)
    for j in range(len(points)):
        x, y = points[j]
        away = math.hypot(x, y) * half_rad / frame[2] + 1e-9
        cells[j, 0] = math.floor((cos * x - sin * y + frame[0]) / frame[2] - away)
        cells[j, 1] = math.floor((sin * x + cos * y + frame[1]) / frame[2] - away)
        cells[j, 2], cells[j, 3] = 0, CHANNELS - 1
        tx, ty = tangents[j]
        if tx != 0.0 or ty != 0.0:
            turn = (math.atan2(ty, tx) + angle) / (0.5 * math.pi) + 0.5
            spread = half_rad / (0.5 * math.pi) + 1e-9
            cells[j, 2] = math.floor(turn - spread)
            cells[j, 3] = min(math.floor(turn + spread), cells[j, 2] + CHANNELS - 1)


@lean
def _bound(
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


@lean
def _score_above(windows: Grid, cells: Integers, dx: int, dy: int, best: float) -> float:
    """`score` at height FINEST, given up where it cannot reach `best`."""
    _, rows, columns = windows.shape
    total, least = 0, math.floor(255.0 * len(cells) * (best - 1.0))
    for j in range(len(cells)):
        if total < least:
            break
        least += 255
        c, r = cells[j, 0] + dx, cells[j, 1] + dy
        if 0 <= c < columns and 0 <= r < rows:
            total += windows[cells[j, 2], r, c]
    return total / (255.0 * len(cells))


@kernel
def _search(  # noqa: PLR0912, PLR0915
    grids: Grid,
    table: Integers,
    bounds: Grid,
    points: Points,
    tangents: Points,
    angles: Vector,
    frame: Vector,
    reach: int,
    barred: Points,
) -> tuple[float, int, int, int]:
    """Best score above the floor, or -1, its angle index and translation; likely blocks first.

    frame : x, y [m] of the window's centre from the corner of the grid; cell [m]; floor.
    """
    n, count = len(points), len(angles)
    top = FINEST + len(table) - 1
    turn = angles[1] - angles[0]
    firsts = np.zeros(len(table) + 1, np.int64)  # of the angle blocks of each height
    for h in range(FINEST, top + 1):
        firsts[h - FINEST + 1] = firsts[h - FINEST] + ((count - 1) >> h) + 1
    blocks = np.empty((firsts[-1], n, 4), np.int64)
    for h in range(FINEST, top + 1):
        half_rad = 0.5 * ((1 << h) - 1) * turn
        for b in range(firsts[h - FINEST + 1] - firsts[h - FINEST]):
            middle = angles[b << h] + half_rad
            _place(points, tangents, middle, half_rad, frame, blocks[firsts[h - FINEST] + b])
    cells = np.empty((count, n, 3), np.int64)
    places, safe = np.empty((count, n), np.int32), np.empty(count, np.int64)
    for a in range(count):
        safe[a] = project(
            points,
            tangents,
            angles[a],
            frame[0],
            frame[1],
            frame[2],
            grids.shape[2:],
            -reach,
            reach + (1 << FINEST),
            cells[a],
            places[a],
        )

    side = ((2 * reach) >> top) + 1
    turns = ((count - 1) >> top) + 1
    nodes = np.empty((turns * side * side, 3), np.int64)
    limits = np.empty(len(nodes))
    for k in range(len(nodes)):
        nodes[k, 0] = k // (side * side)
        nodes[k, 1] = ((k % side) << top) - reach
        nodes[k, 2] = ((k // side % side) << top) - reach
        block = blocks[firsts[top - FINEST] + nodes[k, 0]]
        limits[k] = _bound(table, bounds, top, block, nodes[k, 1], nodes[k, 2], 0.0)
    stack = np.empty((8 * (top - FINEST + 2), 4), np.int64)
    stacked = np.empty(len(stack))
    children, values = np.empty((8, 3), np.int64), np.empty(8)
    best, reached = frame[3], -1.0
    angle, dx, dy = 0, 0, 0
    for k in np.argsort(-limits, kind="mergesort"):
        if limits[k] <= best:
            break
        stack[0, 0], stacked[0] = top, limits[k]
        stack[0, 1:] = nodes[k]
        depth = 1
        while depth > 0:
            depth -= 1
            if stacked[depth] <= best:
                continue
            h, b, x, y = stack[depth]
            opened = 0
            if h == FINEST:
                for a in range(b << h, min((b + 1) << h, count)):
                    value = _score_above(grids[FINEST], cells[a], x, y, best)
                    if value > best:
                        children[opened, 0], values[opened] = a, value
                        opened += 1
                for i in np.argsort(-values[:opened], kind="mergesort"):
                    if values[i] <= best:
                        break
                    a = children[i, 0]
                    found, fx, fy = descend(
                        grids, cells[a], places[a], safe[a], FINEST, x, y, reach, best, barred[a]
                    )
                    if found > best:
                        best = reached = found
                        angle, dx, dy = a, fx, fy
                continue
            half = 1 << (h - 1)
            for i in range(8):
                turned = 2 * b + (i >> 2)
                cx, cy = x + half * (i & 1), y + half * (i >> 1 & 1)
                if turned << (h - 1) >= count or max(cx, cy) > reach:
                    continue
                block = blocks[firsts[h - 1 - FINEST] + turned]
                value = _bound(table, bounds, h - 1, block, cx, cy, best)
                if value > best:
                    children[opened, 0], children[opened, 1], children[opened, 2] = turned, cx, cy
                    values[opened] = value
                    opened += 1
            for i in np.argsort(values[:opened], kind="mergesort"):  # the best one is opened first
                stack[depth, 0], stacked[depth] = h - 1, values[i]
                stack[depth, 1:] = children[i]
                depth += 1
    return reached, angle, dx, dy
