"""Questions to a finished map: the nearest point of a curve, and what a ray meets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.drawn_grid import draw_grid
from bsmap_cli.mapping.drawn_nearest import nearest
from bsmap_cli.mapping.drawn_rays import cast
from bsmap_cli.mapping.map_document import MapLevel
from bsmap_cli.mapping.sampling import drawn_pieces, evaluate


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
        self._level = level
        self._pieces = drawn_pieces(level)
        self._grid = draw_grid(level, self._pieces)

    def __len__(self) -> int:
        return len(self._pieces.curve)

    def nearest(self, points: Points) -> Nearest:
        """The nearest point of any curve to each of (m, 2) points [m].

        ValueError where the map draws nothing.
        """
        if not len(self):
            raise ValueError("the map draws no curve")
        piece, u = nearest(self._grid, points, self._level.knot_step_m)
        curve = self._pieces.curve[piece]
        feet, _ = evaluate(self._level, curve, u)
        return self._described(points, feet, curve, u)

    def rays(self, origins: Points, angles_rad: Vector, range_max_m: float = np.inf) -> RayHits:
        """The first curve that each ray meets, from (m, 2) origins [m] along (m,) angles."""
        ranges, hits = cast(self._grid, origins, angles_rad, range_max_m)
        met = np.isfinite(ranges)
        along = np.stack((np.cos(angles_rad), np.sin(angles_rad)), axis=-1)
        points = np.where(
            met[:, None], origins + np.where(met, ranges, 0.0)[:, None] * along, np.nan
        )
        ids = np.zeros(len(origins), np.uint32)
        ids[met] = self._level.curve_ids[self._pieces.curve[hits[met]]]
        return RayHits(ranges, points, ids)

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
