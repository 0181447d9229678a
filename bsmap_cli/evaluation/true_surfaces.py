"""The true surfaces of a known world: where they are, where their corners are, what was hit."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from bsmap_cli.geometry.se2 import Points, Vector

PIECE_M = 0.02
SHARP_COS = math.cos(math.radians(30.0))
NEIGHBOURS = 8  # pieces whose middles are nearest: among them is the nearest piece
HIT_M = 0.05  # a beam that ends farther from all surfaces hit none


@dataclass(frozen=True, slots=True)
class TrueSurfaces:
    """Surfaces cut into pieces of at most 2 cm, and their corners; world frame [m].

    starts, ends : (p, 2) of each piece; corners : (c, 2), where a surface ends or turns by more
    than 30 degrees.
    """

    starts: Points
    ends: Points
    corners: Points
    tree: KDTree

    @property
    def middles(self) -> Points:
        """(p, 2) middles of the pieces."""
        return 0.5 * (self.starts + self.ends)

    def distances(self, points: Points) -> Vector:
        """(m,) from each point to the nearest surface [m]."""
        return self._nearest(points)[0]

    def count_hits(self, points: Points) -> NDArray[np.int64]:
        """(p,) how many of the points, ends of beams, lie on each piece."""
        distance, piece = self._nearest(points)
        return np.bincount(piece[distance <= HIT_M], minlength=len(self.starts))

    def _nearest(self, points: Points) -> tuple[Vector, NDArray[np.int64]]:
        count = min(NEIGHBOURS, len(self.starts))
        _, found = self.tree.query(points, k=np.arange(1, count + 1))
        near = np.asarray(found, np.int64)
        start, way = self.starts[near], self.ends[near] - self.starts[near]
        offset = points[:, None] - start
        square = np.maximum((way**2).sum(axis=2), 1e-300)
        along = np.clip((offset * way).sum(axis=2) / square, 0.0, 1.0)
        off = offset - along[..., None] * way
        distance = np.hypot(off[..., 0], off[..., 1])
        best = distance.argmin(axis=1)
        rows = np.arange(len(points))
        return distance[rows, best], near[rows, best]


def cut_surfaces(polylines: list[Points]) -> TrueSurfaces:
    """Cut polylines into pieces and find their corners."""
    starts, ends, corners = [], [], []
    for points in polylines:
        corners.append(_corners(points))
        for a, b in itertools.pairwise(points):
            count = max(math.ceil(math.dist(a, b) / PIECE_M - 1e-9), 1)
            marks = a + np.linspace(0.0, 1.0, count + 1)[:, None] * (b - a)
            starts.append(marks[:-1])
            ends.append(marks[1:])
    begin, end = np.concatenate(starts), np.concatenate(ends)
    return TrueSurfaces(begin, end, np.concatenate(corners), KDTree(0.5 * (begin + end)))


def _corners(points: Points) -> Points:
    way = np.diff(points, axis=0)
    way = way[np.hypot(way[:, 0], way[:, 1]) > 0.0]
    kept = np.concatenate((points[:1], points[:1] + np.cumsum(way, axis=0)))
    unit = way / np.hypot(way[:, 0], way[:, 1])[:, None]
    sharp = (unit[:-1] * unit[1:]).sum(axis=1) < SHARP_COS
    inner = kept[1:-1][sharp]
    if len(unit) > 1 and np.allclose(points[0], points[-1]):
        turns = float(unit[-1] @ unit[0]) < SHARP_COS
        return np.concatenate((inner, points[:1])) if turns else inner
    return np.concatenate((inner, points[[0, -1]]))
