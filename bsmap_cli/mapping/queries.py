"""Questions to a finished map: the nearest point of a curve, and what a ray meets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.map_document import MapLevel
from bsmap_cli.mapping.sampling import DrawnPieces, drawn_pieces, evaluate

SAMPLES_PER_STEP = 8  # of the search for candidates
CHORDS_PER_STEP = 8  # a chord strays from its curve by about 2e-3 of the knot step
CANDIDATES = 16
NEWTON_STEPS = 10
PAIRS_AT_ONCE = 4_000_000


@dataclass(frozen=True, slots=True)
class Nearest:
    """The nearest points of the map's curves to (m, 2) points, all arrays (m,) or (m, 2).

    points : on the curves [m]; tangents : (m, 2) unit vectors; distance_m : [m]; free_side : on
    the side the robot saw the curve from (left of its direction); curve_id; tau_m : absolute [m].
    """

    points: Points
    tangents: Points
    distance_m: Vector
    free_side: NDArray[np.bool_]
    curve_id: NDArray[np.uint32]
    tau_m: Vector


@dataclass(frozen=True, slots=True)
class RayHits:
    """Where (m,) rays first meet a curve: range_m is inf and curve_id 0 where they meet none."""

    range_m: Vector
    points: Points
    curve_id: NDArray[np.uint32]


class MapQuery:
    """Answers questions about the drawn curves of one level."""

    def __init__(self, level: MapLevel) -> None:
        from scipy.spatial import cKDTree

        self._level = level
        self._pieces = drawn_pieces(level)
        self._piece, self._u = _parameters(self._pieces, SAMPLES_PER_STEP)
        samples, _ = evaluate(level, self._pieces.curve[self._piece], self._u)
        self._tree = cKDTree(samples)
        self._chords = _chords(level, self._pieces)

    def __len__(self) -> int:
        return len(self._pieces.curve)

    def nearest(self, points: Points) -> Nearest:
        """The nearest point of any curve to each of (m, 2) points [m].

        Candidates are the nearest samples; each is refined to the foot point on its curve.
        ValueError where the map draws nothing.
        """
        if not len(self):
            raise ValueError("the map draws no curve")
        count = min(CANDIDATES, len(self._u))
        found = self._tree.query(points, k=np.arange(1, count + 1))
        reach, candidates = np.asarray(found[0]), np.asarray(found[1])
        # what lies farther than the best sample by more than two samples apart cannot win
        slack = 2.0 * self._level.knot_step_m / SAMPLES_PER_STEP
        row, rank = np.nonzero(reach <= reach[:, :1] + slack)
        piece, u = self._piece[candidates[row, rank]], self._u[candidates[row, rank]]
        curve, targets = self._pieces.curve[piece], points[row]
        low, high = self._pieces.start[piece], self._pieces.end[piece]
        for _ in range(NEWTON_STEPS):
            u = np.clip(u - self._newton_step(curve, u, targets), low, high)
        feet, _ = evaluate(self._level, curve, u)
        distance = np.hypot(*(targets - feet).T)
        order = np.lexsort((distance, row))
        best = order[np.searchsorted(row[order], np.arange(len(points)))]
        return self._described(points, feet[best], curve[best], u[best])

    def rays(self, origins: Points, angles_rad: Vector, range_max_m: float = np.inf) -> RayHits:
        """The first curve that each ray meets, from (m, 2) origins [m] along (m,) angles."""
        ranges, hits = np.full(len(origins), np.inf), np.zeros(len(origins), np.int64)
        start, end, piece = self._chords
        at_once = max(1, PAIRS_AT_ONCE // max(len(start), 1))
        for first in range(0, len(origins), at_once):
            rows = slice(first, first + at_once)
            if len(start):
                ranges[rows], hits[rows] = _first_hits(
                    origins[rows], angles_rad[rows], start, end, piece
                )
        ranges[ranges > range_max_m] = np.inf
        met = np.isfinite(ranges)
        along = np.stack((np.cos(angles_rad), np.sin(angles_rad)), axis=-1)
        points = np.where(
            met[:, None], origins + np.where(met, ranges, 0.0)[:, None] * along, np.nan
        )
        ids = np.zeros(len(origins), np.uint32)
        ids[met] = self._level.curve_ids[self._pieces.curve[hits[met]]]
        return RayHits(ranges, points, ids)

    def _newton_step(self, curve: NDArray[np.int64], u: Vector, targets: Points) -> Vector:
        """Newton on the squared distance, Gauss-Newton where that is not convex [knot steps]."""
        place, _ = evaluate(self._level, curve, u)
        first, _ = evaluate(self._level, curve, u, derivative=1)
        second, _ = evaluate(self._level, curve, u, derivative=2)
        away = place - targets
        slope = np.einsum("mi,mi->m", away, first)
        speed = np.einsum("mi,mi->m", first, first)
        bend = speed + np.einsum("mi,mi->m", away, second)
        step = slope / np.where(bend > 0.02 * speed, bend, np.maximum(speed, 1e-12))
        bounded: Vector = np.clip(step, -0.5, 0.5)
        return bounded

    def _described(
        self, points: Points, feet: Points, curve: NDArray[np.int64], u: Vector
    ) -> Nearest:
        level = self._level
        velocity, _ = evaluate(level, curve, u, derivative=1)
        tangents = velocity / np.maximum(np.hypot(*velocity.T), 1e-300)[:, None]
        away = points - feet
        lattice = level.first_indices[curve].astype(np.float64) + level.degree
        return Nearest(
            points=feet,
            tangents=tangents,
            distance_m=np.hypot(*away.T),
            free_side=tangents[:, 0] * away[:, 1] - tangents[:, 1] * away[:, 0] >= 0.0,
            curve_id=level.curve_ids[curve],
            tau_m=(lattice + u) * level.knot_step_m,
        )


def _parameters(pieces: DrawnPieces, per_step: int) -> tuple[NDArray[np.int64], Vector]:
    """Piece and u [knot steps] of evenly spaced samples, both ends of each piece among them."""
    counts = np.maximum(np.ceil((pieces.end - pieces.start) * per_step), 1).astype(np.int64) + 1
    piece = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(piece)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = number / (counts[piece] - 1)
    return piece, (1.0 - share) * pieces.start[piece] + share * pieces.end[piece]


def _chords(level: MapLevel, pieces: DrawnPieces) -> tuple[Points, Points, NDArray[np.int64]]:
    """Start and end of the chords that stand for the curves, and the piece of each."""
    piece, u = _parameters(pieces, CHORDS_PER_STEP)
    points, _ = evaluate(level, pieces.curve[piece], u)
    within = piece[1:] == piece[:-1]
    return points[:-1][within], points[1:][within], piece[:-1][within]


def _first_hits(
    origins: Points, angles_rad: Vector, start: Points, end: Points, piece: NDArray[np.int64]
) -> tuple[Vector, NDArray[np.int64]]:
    """Range [m] and piece of the first chord each ray meets; every ray against every chord."""
    cos, sin = np.cos(angles_rad)[:, None], np.sin(angles_rad)[:, None]
    along, across = end - start, start[None] - origins[:, None]
    cross = cos * along[:, 1] - sin * along[:, 0]  # (rays, chords)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        reach = (across[..., 0] * along[:, 1] - across[..., 1] * along[:, 0]) / cross
        share = (across[..., 0] * sin - across[..., 1] * cos) / cross
    met = (cross != 0.0) & (reach >= 0.0) & (share >= 0.0) & (share <= 1.0)
    reach = np.where(met, reach, np.inf)
    nearest = np.argmin(reach, axis=1)
    return reach[np.arange(len(origins)), nearest], piece[nearest]
