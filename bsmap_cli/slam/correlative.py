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
from bsmap_cli.slam.search_window import heights_for

Integers = NDArray[np.int64]
Places = NDArray[np.int32]

BATCH = 32  # points that are summed up before anyone asks whether it is worth while


@inlined
def _channel(tx: float, ty: float) -> int:
    """Channel of a direction: 0 east, 1 north, 2 west, 3 south; a diagonal is of the next one."""
    below = 0 if ty >= -tx else 3  # all are worked out, and one is chosen, without a jump
    above = 1 if tx > -ty else 2 if ty > tx else 3
    return below if tx > ty else above


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
    across, up, x, y = cos / cell_m, sin / cell_m, x / cell_m, y / cell_m
    safe, end = 0, len(points)
    for j in range(len(points)):
        c = math.floor(across * points[j, 0] - up * points[j, 1] + x)
        r = math.floor(up * points[j, 0] + across * points[j, 1] + y)
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
def _add_scores(
    grids: NDArray[np.uint8],
    height: int,
    cells: Integers,
    places: Places,
    safe: int,
    dx: int,
    dy: int,
    apart: int,
    least: float,
    totals: Integers,
) -> None:
    """Values of all points, shifted by whole cells, at (dx, dy) and the next corners of a square.

    The others lie `apart` cells farther in x, in y, and in both. Where none of the four can come
    to more than `least`, the sums are given up.
    """
    _, channels, rows, columns = grids.shape
    plane = grids[height].reshape(channels * rows * columns)
    shift, up = dy * columns + dx, apart * columns
    near = right = above = far = 0
    n, done = len(cells), 0
    while done < safe:
        end = min(done + BATCH, safe)
        for j in range(done, end):
            at = np.uint64(places[j] + shift)  # a signed index would be asked whether it is below 0
            near += plane[at]
            right += plane[at + np.uint64(apart)]
            above += plane[at + np.uint64(up)]
            far += plane[at + np.uint64(up + apart)]
        done = end
        if max(near, right, above, far) + 255 * (n - done) <= least:
            break
    totals[0], totals[1], totals[2], totals[3] = near, right, above, far
    for j in range(safe, n):
        for k in range(4):
            c, r = cells[j, 0] + dx + apart * (k & 1), cells[j, 1] + dy + apart * (k >> 1)
            if 0 <= c < columns and 0 <= r < rows:
                totals[k] += grids[height, cells[j, 2], r, c]


@part
def descend(
    grids: NDArray[np.uint8],
    cells: Integers,
    places: Places,
    safe: int,
    height: int,
    dx: int,
    dy: int,
    bound: float,
    reach: int,
    best: float,
    barred: Vector,
) -> tuple[float, int, int]:
    """Best translation inside one block of 2^height cells, if it beats `best`.

    bound : score of the block. reach : translations beyond it lie outside the window, whatever the
    block. barred : dx, dy and radius [cells] of a disc that does not count.
    """
    stack = np.empty((4 * (height + 1) + 4, 3), np.int64)
    bounds = np.empty(len(stack))
    stack[0, 0], stack[0, 1], stack[0, 2] = height, dx, dy
    bounds[0] = bound
    depth = 1
    found_x, found_y = dx, dy
    found = -1.0
    full = 255.0 * len(cells)
    totals, order = np.empty(4, np.int64), np.empty(4, np.int64)
    while depth > 0:
        depth -= 1
        if bounds[depth] <= best:
            continue
        h, x, y = stack[depth]
        if h == 0:
            if (x - barred[0]) ** 2 + (y - barred[1]) ** 2 >= barred[2] ** 2:
                best = found = bounds[depth]
                found_x, found_y = x, y
            continue
        half = 1 << (h - 1)
        _add_scores(grids, h - 1, cells, places, safe, x, y, half, best * full, totals)
        for k in range(4):
            place = k
            while place > 0 and totals[order[place - 1]] > totals[k]:
                order[place] = order[place - 1]
                place -= 1
            order[place] = k
        for n in range(4):  # best child last, so that it is opened first
            k = int(order[n])
            child_x, child_y = x + half * (k & 1), y + half * (k >> 1)
            if totals[k] / full > best and max(child_x, child_y) <= reach:
                stack[depth, 0], stack[depth, 1], stack[depth, 2] = h - 1, child_x, child_y
                bounds[depth] = totals[k] / full
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
    floor: float,
    cells: Integers,
    places: Places,
    safe: Integers,
    bounds: Points,
) -> None:
    """Cells and places of the points at each angle; what no shift within a block can exceed.

    bounds : (angles, rows, columns) of blocks; less where a block is below `floor`.
    """
    top = grids.shape[0] - 1
    block = 1 << top
    side = bounds.shape[1]
    full = 255.0 * len(points)
    totals = np.empty(4, np.int64)
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
            side * block - reach,
            cells[a],
            places[a],
        )
        for row in range(0, side, 2):
            for column in range(0, side, 2):
                bx, by = column * block - reach, row * block - reach
                _add_scores(
                    grids, top, cells[a], places[a], safe[a], bx, by, block, floor * full, totals
                )
                for k in range(4):
                    bounds[a, row + (k >> 1), column + (k & 1)] = totals[k] / full


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
    side = bounds.shape[1]
    best, score = floor, -1.0
    angle, dx, dy = 0, 0, 0
    for k in order:
        a, row, column = k // (side * side), k // side % side, k % side
        bound = bounds[a, row, column]
        if bound <= best:
            break
        x, y = column * block - reach, row * block - reach
        if max(x, y) > reach:
            continue
        found, fx, fy = descend(
            grids, cells[a], places[a], safe[a], top, x, y, bound, reach, best, barred[a]
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
    grids, cell_m = likelihood.grids[: heights_for(reach)], likelihood.cell_m
    block, (x, y) = 1 << (len(grids) - 1), centre[:2] - likelihood.origin_m
    cells = np.empty((len(angles), len(points), 3), np.int64)
    places, safe = np.empty(cells.shape[:2], np.int32), np.empty(len(angles), np.int64)
    side = 2 * math.ceil((2 * reach + 1) / (2 * block))  # even: four blocks are asked at a time
    bounds = np.empty((len(angles), side, side))
    _bound(grids, points, tangents, angles, x, y, reach, cell_m, floor, cells, places, safe, bounds)
    order = np.argsort(-bounds, axis=None, kind="stable")  # likely blocks first
    score, angle, dx, dy = _search(grids, cells, places, safe, bounds, order, reach, floor, barred)
    return score, angles[angle], dx, dy
