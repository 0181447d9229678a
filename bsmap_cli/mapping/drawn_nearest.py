"""The nearest drawn point: ring after ring of cells, until no farther one can be nearer."""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.geometry.compiled import inlined, lean
from bsmap_cli.geometry.kernels import magnitude, polynomial_jet
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.drawn_grid import CHORDS, DrawnGrid, Integers, load, scratch

NEWTON_STEPS = 10


@inlined
def _foot(
    grid: DrawnGrid,
    piece: int,
    u: float,
    px: float,
    py: float,
    polynomial: Points,
    buffer: Points,
) -> tuple[float, float]:
    """u [knot steps] of the point of a piece nearest to (px, py), from u on, and its distance.

    Newton on the squared distance, Gauss-Newton where that is not convex.
    """
    first, low, high = grid.pieces[piece]
    last = math.ceil(high) - 1
    distance = math.inf
    for step in range(NEWTON_STEPS + 1):
        span = max(min(math.floor(u), last), 0)
        load(grid, int(first) + span, polynomial, buffer)
        x, y, dx, dy, ddx, ddy = polynomial_jet(polynomial, u - span)
        distance = magnitude(px - x, py - y)
        if step == NEWTON_STEPS:
            break
        slope = (x - px) * dx + (y - py) * dy
        speed = dx * dx + dy * dy
        bend = speed + (x - px) * ddx + (y - py) * ddy
        move = slope / (bend if bend > 0.02 * speed else max(speed, 1e-12))
        u = min(max(u - min(max(move, -0.5), 0.5), low), high)
    return u, distance


@lean
def _nearest(
    grid: DrawnGrid,
    points: Points,
    slack_m: float,
    polynomial: Points,
    buffer: Points,
    pieces: Integers,
    places: Vector,
) -> None:
    """Piece and u of the nearest drawn point to each point.

    A span is refined where the best of its samples is within `slack_m` of the best so far.
    """
    side = grid.cell_m
    for index in range(len(points)):
        px, py = points[index]
        column = math.floor((px - grid.origin[0]) / side)
        row = math.floor((py - grid.origin[1]) / side)
        ring = max(0, -column, column - grid.columns + 1, -row, row - grid.rows + 1)
        farthest = max(column, grid.columns - 1 - column, row, grid.rows - 1 - row)
        best = math.inf
        while ring <= farthest and best > (ring - 1) * side:
            for r in range(max(row - ring, 0), min(row + ring, grid.rows - 1) + 1):
                edge = abs(r - row) == ring
                c = max(column - ring, 0) if edge or column - ring >= 0 else column + ring
                while c <= min(column + ring, grid.columns - 1):
                    cell = r * grid.columns + c
                    for k in range(grid.starts[cell], grid.starts[cell + 1]):
                        item = grid.items[k]
                        load(grid, grid.spans[item, 0], polynomial, buffer)
                        begin, end = grid.parts[item]
                        least, u = math.inf, 0.0
                        for i in range(CHORDS + 1):
                            f = begin + (end - begin) * i / CHORDS
                            x, y, _, _, _, _ = polynomial_jet(polynomial, f)
                            distance = magnitude(px - x, py - y)
                            if distance < least:
                                least, u = distance, f
                        if least > best + slack_m:
                            continue
                        piece = grid.spans[item, 1]
                        u += grid.spans[item, 0] - grid.pieces[piece, 0]
                        u, distance = _foot(grid, piece, u, px, py, polynomial, buffer)
                        if distance < best:
                            best, pieces[index], places[index] = distance, piece, u
                    c += 1 if edge else max(2 * ring, 1)
            ring += 1


def nearest(grid: DrawnGrid, points: Points, knot_step_m: float) -> tuple[Integers, Vector]:
    """Piece and u [knot steps] of the drawn point nearest to each of (m, 2) points."""
    pieces, places = np.zeros(len(points), np.int64), np.zeros(len(points))
    asked = np.ascontiguousarray(points, np.float64)
    slack_m = 2.0 * knot_step_m / CHORDS
    _nearest(grid, asked, slack_m, *scratch(grid), pieces, places)
    return pieces, places
