"""How near a map is to the true surfaces, and how much of them it shows.

Importing this module imports scipy.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from bsmap_cli.evaluation.redundancy import SAMPLES_PER_STEP, redundancy
from bsmap_cli.evaluation.trajectory_error import rms
from bsmap_cli.evaluation.true_surfaces import TrueSurfaces
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.map_document import MapLevel
from bsmap_cli.mapping.sampling import sample_level

CORNER_REACH = 2.0  # [knot steps]
COVER_M = 0.03
LEAST_HITS = 10
COVER_STEP_M = 0.005
IDENTITY = SE2.identity()


@dataclass(frozen=True, slots=True, kw_only=True)
class MapQuality:
    """Distances [m] from samples of the curves to the nearest true surface, and coverage.

    away_rms_m : over samples farther than two knot steps from corners, None where there are none.
    coverage : share of the surface pieces hit by ten beams or more that lie within 3 cm of a
        curve, None where none was hit so often.
    """

    rms_m: float
    p95_m: float
    max_m: float
    away_rms_m: float | None
    coverage: float | None
    redundancy: float
    samples: int

    def as_json(self) -> dict[str, Any]:
        """The figures as JSON values."""
        return asdict(self)


def map_quality(
    level: MapLevel,
    surfaces: TrueSurfaces,
    *,
    pose_world_map: SE2 = IDENTITY,
    hits: NDArray[np.int64] | None = None,
) -> MapQuality | None:
    """Compare the drawn curves with the truth; None where nothing is drawn.

    pose_world_map : the map's frame in the world, for `slam` the base's true pose at the first
    scan. hits : (p,) beams on each piece, see `TrueSurfaces.count_hits`; without it all count.
    """
    samples = sample_level(level, level.knot_step_m / SAMPLES_PER_STEP)
    if not len(samples.points):
        return None
    points = pose_world_map.transform(samples.points)
    distance = surfaces.distances(points)
    corner, _ = KDTree(surfaces.corners).query(points) if len(surfaces.corners) else (np.inf, None)
    away = distance[np.broadcast_to(corner, distance.shape) > CORNER_REACH * level.knot_step_m]
    return MapQuality(
        rms_m=rms(distance),
        p95_m=float(np.percentile(distance, 95)),
        max_m=float(distance.max()),
        away_rms_m=rms(away) if len(away) else None,
        coverage=_coverage(level, surfaces, pose_world_map, hits),
        redundancy=redundancy(level, samples),
        samples=len(points),
    )


def _coverage(
    level: MapLevel, surfaces: TrueSurfaces, pose_world_map: SE2, hits: NDArray[np.int64] | None
) -> float | None:
    middles = surfaces.middles if hits is None else surfaces.middles[hits >= LEAST_HITS]
    if not len(middles):
        return None
    curves = pose_world_map.transform(sample_level(level, COVER_STEP_M).points)
    distance, _ = KDTree(curves).query(middles)
    return float(np.mean(distance <= COVER_M))
