"""The edges of a pose graph: where one node is seen from another, and how surely."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector

Integers = NDArray[np.int64]


class Edges(NamedTuple):
    """Columns of n edges: second node seen from the first.

    first, second : (n,) nodes; poses : (n, 3); informations : (n, 3, 3) inverse covariances in
    the frame of the first; loops : (n,) bool, edges that may prove wrong.
    """

    first: Integers
    second: Integers
    poses: Points
    informations: Points
    loops: NDArray[np.bool_]


def _empty(rows: int) -> Edges:
    return Edges(
        np.empty(rows, np.int64),
        np.empty(rows, np.int64),
        np.empty((rows, 3)),
        np.empty((rows, 3, 3)),
        np.empty(rows, np.bool_),
    )


class EdgeList:
    """Edges as they come; the room for them doubles."""

    def __init__(self) -> None:
        self._room = _empty(16)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def columns(self) -> Edges:
        """All edges so far: views that the next `add` may leave behind."""
        used: list[Any] = [column[: self._count] for column in self._room]
        return Edges(*used)

    def add(self, i: int, j: int, pose_i_j: Vector, information: Points, *, loop: bool) -> None:
        """One edge; `information` is the inverse covariance of `pose_i_j` in the frame of i."""
        if self._count == len(self._room.first):
            larger = _empty(2 * self._count)
            for new, old in zip(larger, self._room, strict=True):
                new[: self._count] = old
            self._room = larger
        row: tuple[Any, ...] = (i, j, pose_i_j, information, loop)
        for column, value in zip(self._room, row, strict=True):
            column[self._count] = value
        self._count += 1
