"""Find a scan in a submap without a good guess, in windows up to whole buildings, all round.

Few blocks of translations are asked at every angle, one by one. In wide windows blocks span angles
as well: a block of height h holds 2^h translations each way and 2^h angles, in which no point
moves by more than 2^h - 1 cells, so that windows of 2^(h+1) cells bound them all. Blocks of this
kind are only as fine as 8 cells; from there on each angle is searched by itself.
"""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.geometry.compiled import kernel, lean_part
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.slam.block_bounds import FINEST, bound, coarse_levels
from bsmap_cli.slam.correlative import Integers, Places, descend, project, search_angles
from bsmap_cli.slam.likelihood import CHANNELS, Grid, Likelihood
from bsmap_cli.slam.search_window import Peak, Window, window_grid

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
    """The best pose of a scan in a submap within a window, or None where none scores `floor`.

    Parameters
    ----------
    points, tangents : (n, 2) of the scan, body frame; thinned to the cells, they count alike.
    barred : poses within `apart_m` and `apart_rad` of this peak do not count: what is then found
        is a rival of it.
    """
    if len(points) == 0:
        return None
    heights, cell_m, centre = len(likelihood.grids), likelihood.cell_m, window.centre
    angles, discs, reach = window_grid(cell_m, points, window, barred, apart_m, apart_rad)
    block = 1 << (heights - 1)
    asked = len(angles) * ((2 * reach + block) // block) ** 2
    engine = search_angles if heights <= FINEST or asked <= FEW_BLOCKS else search_blocks
    score, angle, dx, dy = engine(likelihood, points, tangents, centre, angles, discs, reach, floor)
    if score < 0.0:
        return None
    return Peak(np.array([centre[0] + dx * cell_m, centre[1] + dy * cell_m, angle]), score)


def search_blocks(
    likelihood: Likelihood,
    points: Points,
    tangents: Points,
    centre: Vector,
    angles: Vector,
    barred: Points,
    reach: int,
    floor: float,
) -> tuple[float, float, int, int]:
    """`search_angles`, in blocks of angles: the same arguments, the same best score."""
    order = np.argsort(angles, kind="stable")
    angles, barred = angles[order], barred[order]
    top = max(FINEST + 1, math.ceil(math.log2(max(len(angles), 2 * reach + 1) / 8)))
    cell_m, origin = likelihood.cell_m, likelihood.origin_m
    # neighbours are met or missed together: far from one another, few points tell of all
    spread = np.argsort(np.arange(len(points)) * SPREAD % 1.0, kind="stable")
    points, tangents = points[spread], tangents[spread]
    table, bounds = coarse_levels(likelihood.grids[FINEST], top)
    turn = angles[1] - angles[0] if len(angles) > 1 else 0.0
    frame = np.array([centre[0] - origin[0], centre[1] - origin[1], cell_m, turn])
    firsts = np.cumsum([0, *(((len(angles) - 1) >> h) + 1 for h in range(FINEST, top + 1))])
    blocks = np.empty((firsts[-1], len(points), 4), np.int64)
    cells = np.empty((len(angles), len(points), 3), np.int64)
    places, safe = np.empty(cells.shape[:2], np.int32), np.empty(len(angles), np.int64)
    side, turns = ((2 * reach) >> top) + 1, ((len(angles) - 1) >> top) + 1
    at, row, column = (index.ravel() for index in np.indices((turns, side, side)))
    nodes = np.stack((at, (column << top) - reach, (row << top) - reach), axis=1)
    limits = np.empty(len(nodes))
    grids, size = likelihood.grids, np.array([*likelihood.grids.shape[2:], reach])
    _project_all(points, tangents, angles, frame, size, firsts, blocks, cells, places, safe)
    _bound_all(table, bounds, top, blocks[firsts[-2] :], nodes, limits)
    order = np.argsort(-limits, kind="stable")
    score, angle, dx, dy = _search(
        grids,
        table,
        bounds,
        firsts,
        blocks,
        cells,
        places,
        safe,
        nodes[order],
        limits[order],
        reach,
        floor,
        barred,
    )
    return score, angles[angle], dx, dy


@lean_part
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


@lean_part
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
def _project_all(
    points: Points,
    tangents: Points,
    angles: Vector,
    frame: Vector,
    size: Integers,
    firsts: Integers,
    blocks: Integers,
    cells: Integers,
    places: Places,
    safe: Integers,
) -> None:
    """Where the points lie at each angle, and in each block of angles of each height.

    frame : x, y [m] of the window's centre from the corner of the grid; cell [m]; turn from one
    angle to the next. size : rows and columns of the grid, reach of the window. firsts : the first
    block of each height.
    """
    for k in range(len(firsts) - 1):
        half_rad = 0.5 * ((1 << FINEST + k) - 1) * frame[3]
        for b in range(firsts[k + 1] - firsts[k]):
            middle = angles[b << FINEST + k] + half_rad
            _place(points, tangents, middle, half_rad, frame, blocks[firsts[k] + b])
    for a in range(len(angles)):
        safe[a] = project(
            points,
            tangents,
            angles[a],
            frame[0],
            frame[1],
            frame[2],
            (size[0], size[1]),
            -size[2],
            size[2] + (1 << FINEST),
            cells[a],
            places[a],
        )


@kernel
def _bound_all(
    table: Integers, bounds: Grid, height: int, blocks: Integers, nodes: Integers, limits: Vector
) -> None:
    """What each node (block of angles, x, y) of one height cannot score more than."""
    for k in range(len(nodes)):
        block = blocks[nodes[k, 0]]
        limits[k] = bound(table, bounds, height, block, nodes[k, 1], nodes[k, 2], 0.0)


@lean_part
def _enter(
    children: Integers, values: Vector, count: int, value: float, b: int, x: int, y: int
) -> None:
    """Put a child among those before it, in ascending order of their values."""
    place = count
    while place > 0 and values[place - 1] > value:
        values[place] = values[place - 1]
        for i in range(3):
            children[place, i] = children[place - 1, i]
        place -= 1
    values[place] = value
    children[place, 0], children[place, 1], children[place, 2] = b, x, y


@kernel
def _search(  # noqa: PLR0912
    grids: Grid,
    table: Integers,
    bounds: Grid,
    firsts: Integers,
    blocks: Integers,
    cells: Integers,
    places: Places,
    safe: Integers,
    nodes: Integers,
    limits: Vector,
    reach: int,
    floor: float,
    barred: Points,
) -> tuple[float, int, int, int]:
    """Best score above `floor`, or -1, its angle index and translation; nodes in this order."""
    top = FINEST + len(table) - 1
    stack = np.empty((8 * (top - FINEST + 2), 4), np.int64)
    stacked = np.empty(len(stack))
    children, values = np.empty((8, 3), np.int64), np.empty(8)
    best, reached = floor, -1.0
    angle, dx, dy = 0, 0, 0
    for k in range(len(nodes)):
        if limits[k] <= best:
            break
        stack[0, 0], stacked[0] = top, limits[k]
        stack[0, 1], stack[0, 2], stack[0, 3] = nodes[k]
        depth = 1
        while depth > 0:
            depth -= 1
            if stacked[depth] <= best:
                continue
            h, b, x, y = stack[depth]
            opened = 0
            if h == FINEST:
                for a in range(b << h, min((b + 1) << h, len(cells))):
                    value = _score_above(grids[FINEST], cells[a], x, y, best)
                    if value > best:
                        _enter(children, values, opened, value, a, x, y)
                        opened += 1
                for i in range(opened - 1, -1, -1):
                    if values[i] <= best:
                        break
                    a = children[i, 0]
                    found, fx, fy = descend(
                        grids,
                        cells[a],
                        places[a],
                        safe[a],
                        FINEST,
                        x,
                        y,
                        values[i],
                        reach,
                        best,
                        barred[a],
                    )
                    if found > best:
                        best = reached = found
                        angle, dx, dy = a, fx, fy
                continue
            half = 1 << (h - 1)
            for i in range(8):
                part = 2 * b + (i >> 2)
                cx, cy = x + half * (i & 1), y + half * (i >> 1 & 1)
                if part << (h - 1) >= len(cells) or max(cx, cy) > reach:
                    continue
                block = blocks[firsts[h - 1 - FINEST] + part]
                value = bound(table, bounds, h - 1, block, cx, cy, best)
                if value > best:
                    _enter(children, values, opened, value, part, cx, cy)
                    opened += 1
            for i in range(opened):  # the best one last, so that it is opened first
                stack[depth, 0], stacked[depth] = h - 1, values[i]
                stack[depth, 1], stack[depth, 2], stack[depth, 3] = children[i]
                depth += 1
    return reached, angle, dx, dy
