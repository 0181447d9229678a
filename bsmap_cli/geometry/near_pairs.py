"""Which points of two sets are near each other: a hash of square cells."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector

Integers = NDArray[np.int64]
Pairs = tuple[Integers, Integers]

MOST_PAIRS = 5e6  # that are looked at together: some hundred megabytes
NO_CELL = np.iinfo(np.int64).max


class Cells(NamedTuple):
    """Points sorted by the cell they lie in.

    A cell (column, row) has the key row * columns + column. keys : (m,) ascending; order : (m,)
    the point of each key.
    """

    low: Vector
    reach_m: float
    columns: int
    keys: Integers
    order: Integers

    def keys_of(self, points: Points) -> Integers:
        """(n,) the key of the cell of each point."""
        return _keys(points, self.low, self.reach_m, self.columns)

    def pairs(self, points: Points) -> Pairs:
        """Rows of (n, 2) points and of those in the 3 x 3 cells round their own.

        That is all pairs that are within reach, and a few more.
        """
        key = self.keys_of(points)
        found: list[Pairs] = []
        for row in (-1, 0, 1):
            # three cells of one row have consecutive keys
            here = key + row * self.columns
            begin = np.searchsorted(self.keys, here - 1)
            count = np.searchsorted(self.keys, here + 1, side="right") - begin
            which = np.repeat(np.arange(len(points)), count)
            number = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
            found.append((which, self.order[begin[which] + number]))
        return np.concatenate([a for a, _ in found]), np.concatenate([b for _, b in found])

    def blocks(self, rows: Integers) -> list[Integers]:
        """Rows of points that ask, in parts that make some million pairs each, about."""
        # what is drawn many times over makes many
        count = np.diff(np.append(_firsts(self.keys), len(self.keys))).astype(np.float64)
        pairs = 9.0 * len(rows) * float(count @ count) / max(len(self.keys), 1)
        return np.array_split(rows, max(math.ceil(pairs / MOST_PAIRS), 1))


def sort_into_cells(points: Points, reach_m: float, asking: Points) -> Cells:
    """(m, 2) points in cells of side `reach_m`, for questions from where (n, 2) `asking` lie."""
    low = np.minimum(points.min(axis=0), asking.min(axis=0)) - reach_m
    widest_m = max(points[:, 0].max(), asking[:, 0].max()) - low[0]
    columns = int(widest_m // reach_m) + 2
    keys = _keys(points, low, reach_m, columns)
    order = np.argsort(keys, kind="stable")
    return Cells(low, reach_m, columns, keys[order], order)


def places_near(cells: Cells, places: Vector, points: Points) -> tuple[Vector, Vector]:
    """Least and greatest place of those in the 3 x 3 cells round each of (n, 2) points.

    places : (m,) of the points in the cells. Where the cells are empty: inf and -inf.
    """
    first = _firsts(cells.keys)
    ordered = places[cells.order]
    keys = np.append(cells.keys[first], [NO_CELL] * 3)
    least = np.append(np.minimum.reduceat(ordered, first), [np.inf] * 3)
    most = np.append(np.maximum.reduceat(ordered, first), [-np.inf] * 3)
    # points come in curve order: those in a row that share a cell are asked once
    key = cells.keys_of(points)
    run = _firsts(key)
    low, high = np.full(len(run), np.inf), np.full(len(run), -np.inf)
    for row in (-1, 0, 1):
        here = key[run] + row * cells.columns
        at = np.searchsorted(keys, here - 1)
        for step in range(3):
            there = keys[at + step] <= here + 1
            np.minimum(low, least[at + step], out=low, where=there)
            np.maximum(high, most[at + step], out=high, where=there)
    lengths = np.diff(np.append(run, len(key)))
    return np.repeat(low, lengths), np.repeat(high, lengths)


def _keys(points: Points, low: Vector, side_m: float, columns: int) -> Integers:
    column, row = np.floor((points - low) / side_m).astype(np.int64).T
    return np.asarray(row * columns + column)


def _firsts(keys: Integers) -> Integers:
    """Where runs of equal keys begin."""
    return np.flatnonzero(np.concatenate(([True], keys[1:] != keys[:-1])))
