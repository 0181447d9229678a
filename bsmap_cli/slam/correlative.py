"""Find a scan in a submap without a good guess: branch and bound over translations and angles.

Complete within its window: a block of translations is only left aside when even the best value of
each point anywhere in the block could not beat what is already found.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, kernel, lean_part, part
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.slam.likelihood import Likelihood

Integers = NDArray[np.int64]
Places = NDArray[np.int32]


@inlined
def _channel(tx: float, ty: float) -> int:
    """Channel of a direction: 0 east, 1 north, 2 west, 3 south; a diagonal is of the next one."""
    if tx > ty:
        return 0 if ty >= -tx else 3
    return 1 if tx > -ty else 2 if ty > tx else 3


@lean_part
def project(
    points: Points,
    tangents: Points,
    angle: float,
    x: float,
    y: float,
    cell_m: float,
    shape: tuple[int, int],
    low: int,
    high: int,
    cells: Integers,
    places: Places,
) -> int:
    """Cells of the points, turned by `angle` and placed at (x, y), by row, column and channel.

    Those that stay on the grid whatever the shift from `low` to `high` go first, and are written
    to `places`, within a plane of channels; their number.
    """
    rows, columns = shape
    cos, sin = math.cos(angle), math.sin(angle)
    safe, end = 0, len(points)
    for j in range(len(points)):
        c = math.floor((cos * points[j, 0] - sin * points[j, 1] + x) / cell_m)
        r = math.floor((sin * points[j, 0] + cos * points[j, 1] + y) / cell_m)
        tx = cos * tangents[j, 0] - sin * tangents[j, 1]
        ty = sin * tangents[j, 0] + cos * tangents[j, 1]
        channel = _channel(tx, ty)
        if c + low >= 0 and r + low >= 0 and c + high < columns and r + high < rows:
            places[safe] = (channel * rows + r) * columns + c
            k = safe
            safe += 1
        else:
            end -= 1
            k = end
        cells[k, 0], cells[k, 1], cells[k, 2] = c, r, channel
    return safe


@lean_part
def _score(
    grids: NDArray[np.uint8],
    height: int,
    cells: Integers,
    places: Places,
    safe: int,
    dx: int,
    dy: int,
) -> float:
    """Mean likelihood of the points shifted by whole cells, or a bound of it above height 0."""
    _, channels, rows, columns = grids.shape
    total = 0
    plane = grids[height].reshape(channels * rows * columns)
    shift = dy * columns + dx
    for j in range(safe):
        total += plane[places[j] + shift]
    for j in range(safe, len(cells)):
        c, r = cells[j, 0] + dx, cells[j, 1] + dy
        if 0 <= c < columns and 0 <= r < rows:
            total += grids[height, cells[j, 2], r, c]
    return total / (255.0 * len(cells))


@part
def descend(
    grids: NDArray[np.uint8],
    cells: Integers,
    places: Places,
    safe: int,
    height: int,
    dx: int,
    dy: int,
    reach: int,
    best: float,
    barred: Vector,
) -> tuple[float, int, int]:
    """Best translation inside one block of 2^height cells, if it beats `best`.

    reach : translations beyond it lie outside the window, whatever the block.
    barred : dx, dy and radius [cells] of a disc that does not count.
    """
    stack = np.empty((4 * (height + 1) + 4, 3), np.int64)
    bounds = np.empty(len(stack))
    stack[0, 0], stack[0, 1], stack[0, 2] = height, dx, dy
    bounds[0] = 2.0
    depth = 1
    found_x, found_y = dx, dy
    found = -1.0
    children, scores, order = np.empty((4, 2), np.int64), np.empty(4), np.empty(4, np.int64)
    while depth > 0:
        depth -= 1
        if bounds[depth] <= best:
            continue
        h, x, y = stack[depth]
        if h == 0:
            if (x - barred[0]) ** 2 + (y - barred[1]) ** 2 < barred[2] ** 2:
                continue
            score = _score(grids, h, cells, places, safe, x, y)
            if score > best:
                best, found, found_x, found_y = score, score, x, y
            continue
        half = 1 << (h - 1)
        for k in range(4):
            children[k, 0] = x + half * (k & 1)
            children[k, 1] = y + half * (k >> 1)
            scores[k] = _score(grids, h - 1, cells, places, safe, children[k, 0], children[k, 1])
            place = k
            while place > 0 and scores[order[place - 1]] > scores[k]:
                order[place] = order[place - 1]
                place -= 1
            order[place] = k
        for n in range(4):  # best child last, so that it is opened first
            k = int(order[n])
            if scores[k] > best and max(children[k, 0], children[k, 1]) <= reach:
                stack[depth, 0] = h - 1
                stack[depth, 1] = children[k, 0]
                stack[depth, 2] = children[k, 1]
                bounds[depth] = scores[k]
                depth += 1
    return found, found_x, found_y


@kernel
def _bound(
    grids: NDArray[np.uint8],
    points: Points,
    tangents: Points,
    angles: Vector,
    x: float,
    y: float,
    reach: int,
    cell_m: float,
    cells: Integers,
    places: Places,
    safe: Integers,
    bounds: Points,
) -> None:
    """Cells and places of the points at each angle; what no shift within a block can exceed."""
    top = grids.shape[0] - 1
    block = 1 << top
    blocks = (2 * reach + 1 + block - 1) // block
    for a in range(len(angles)):
        safe[a] = project(
            points,
            tangents,
            angles[a],
            x,
            y,
            cell_m,
            grids.shape[2:],
            -reach,
            reach + block,
            cells[a],
            places[a],
        )
        for k in range(blocks * blocks):
            bx, by = k % blocks * block - reach, k // blocks * block - reach
            bounds[a, k] = _score(grids, top, cells[a], places[a], safe[a], bx, by)


@kernel
def _search(
    grids: NDArray[np.uint8],
    cells: Integers,
    places: Places,
    safe: Integers,
    bounds: Points,
    order: Integers,
    reach: int,
    floor: float,
    barred: Points,
) -> tuple[float, int, int, int]:
    """Best score above `floor`, or -1, its angle index and translation; blocks in this order."""
    top = grids.shape[0] - 1
    block = 1 << top
    blocks = (2 * reach + 1 + block - 1) // block
    best, score = floor, -1.0
    angle, dx, dy = 0, 0, 0
    for k in order:
        a, b = k // (blocks * blocks), k % (blocks * blocks)
        if bounds[a, b] <= best:
            break
        bx, by = b % blocks * block - reach, b // blocks * block - reach
        found, fx, fy = descend(
            grids, cells[a], places[a], safe[a], top, bx, by, reach, best, barred[a]
        )
        if found > best:
            best = score = found
            angle, dx, dy = a, fx, fy
    return score, angle, dx, dy


def search_angles(
    likelihood: Likelihood,
    points: Points,
    tangents: Points,
    centre: Vector,
    angles: Vector,
    barred: Points,
    reach: int,
    floor: float,
) -> tuple[float, float, int, int]:
    """Best score above `floor`, or -1, its angle and translation [cells]; each angle by itself.

    barred : dx, dy and radius [cells] of the disc that does not count at each angle.
    """
    cell_m, block = likelihood.cell_m, 1 << (len(likelihood.grids) - 1)
    cells = np.empty((len(angles), len(points), 3), np.int64)
    places, safe = np.empty(cells.shape[:2], np.int32), np.empty(len(angles), np.int64)
    bounds = np.empty((len(angles), math.ceil((2 * reach + 1) / block) ** 2))
    grids, (x, y) = likelihood.grids, centre[:2] - likelihood.origin_m
    _bound(grids, points, tangents, angles, x, y, reach, cell_m, cells, places, safe, bounds)
    order = np.argsort(-bounds, axis=None, kind="stable")  # likely blocks first
    score, angle, dx, dy = _search(grids, cells, places, safe, bounds, order, reach, floor, barred)
    return score, angles[angle], dx, dy
