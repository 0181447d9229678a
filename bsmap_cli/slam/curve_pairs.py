"""Curves of a scan beside the map curves they belong to: what Sec. IV registers.

Which map curve a scan's curve belongs to, and the first guess of its offset, comes from the
centroids of the last scan (eqs. (4)(5)), or from the map itself: samples of the scan's curve vote
for a map curve and an offset with their foot points.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.curve import Curve
from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.mapping.association import match_points
from bsmap_cli.mapping.centroid_tracking import cluster_centroids, track_clusters
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.fitting import fit_curve
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.segmentation import Clusters

VOTES_PER_STEP = 2  # samples of a scan's curve that look for their foot points
VOTE_REACH = 1.0  # longest way from a sample to its foot point [knot steps]
FEWEST_VOTES = 4


@dataclass(slots=True)
class CurvePairs:
    """Pairs of a scan's curve (body frame) and a map curve; lattice units throughout.

    curves : scan curves. supports : (P, 2) the part [u_start, u_end] of each that takes part.
    map_curves : (P,) index in the map. offsets : (P,) what to add to the scan curve's u to get
    the map's.
    """

    curves: list[Curve] = field(default_factory=list)
    supports: list[tuple[float, float]] = field(default_factory=list)
    map_curves: list[int] = field(default_factory=list)
    offsets: list[float] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.curves)

    def add(
        self, curve: Curve, support: tuple[float, float], map_curve: int, offset: float
    ) -> None:
        """One more pair."""
        self.curves.append(curve)
        self.supports.append(support)
        self.map_curves.append(map_curve)
        self.offsets.append(offset)


def pairing(
    curve_map: CurveMap, clusters: Clusters, settings: MappingSettings
) -> Callable[[Vector], CurvePairs]:
    """The association that is set, for the clusters of one scan: pairs as seen from a pose (3,)."""
    if settings.association.method == "centroid":
        return lambda pose: pair_by_centroids(curve_map, clusters, pose, settings)
    curves = scan_curves(curve_map, clusters, settings)
    return lambda pose: pair_by_votes(curve_map, curves, pose)


def scan_curves(curve_map: CurveMap, clusters: Clusters, settings: MappingSettings) -> list[Curve]:
    """Each cluster as a curve of its own, body frame, tau_1 = 0: eqs. (6)-(8)."""
    parts = (clusters.points[a:b] for a, b in pairwise(clusters.starts))
    return [_fit(curve_map, part, 0.0, settings) for part in parts if len(part) > curve_map.degree]


def _fit(curve_map: CurveMap, points: Points, start_m: float, settings: MappingSettings) -> Curve:
    return fit_curve(
        points,
        settings.fitting,
        knot_step_m=curve_map.knot_step_m,
        degree=curve_map.degree,
        start_m=start_m,
    )


def pair_by_centroids(
    curve_map: CurveMap, clusters: Clusters, pose: Vector, settings: MappingSettings
) -> CurvePairs:
    """Pair each cluster with the map curve of the last scan's cluster nearest to it."""
    pairs, last = CurvePairs(), curve_map.tracks
    if last is None:
        return pairs
    step = curve_map.knot_step_m
    means = cluster_centroids(clusters.points, clusters.starts)  # eq. (4)
    means = SE2.from_array(pose).transform(means)
    tracked = track_clusters(means, last, settings.association.track_dist * step)  # eq. (5)
    for c, (begin, end) in enumerate(pairwise(clusters.starts)):
        if tracked[c] >= 0 and end - begin > curve_map.degree:
            start_m = float(last.starts_m[tracked[c]])  # the last tau_1 is the first guess
            curve = _fit(curve_map, clusters.points[begin:end], start_m, settings)
            support = (curve.tau_start_m / step, curve.tau_end_m / step)
            pairs.add(curve, support, int(last.curves[tracked[c]]), 0.0)
    return pairs


def pair_by_votes(curve_map: CurveMap, curves: list[Curve], pose: Vector) -> CurvePairs:
    """Pair curves of the body frame with the map curves near their samples.

    Samples further than a knot step from every curve have no vote; one scan curve may lie on
    several map curves and makes a pair with each.
    """
    pairs = CurvePairs()
    if not curves:
        return pairs
    step, frame = curve_map.knot_step_m, SE2.from_array(pose)
    us = [_votes_at(curve) for curve in curves]
    points = np.concatenate([c.evaluate(u * step) for c, u in zip(curves, us, strict=True)])
    ways = np.concatenate([c.evaluate(u * step, 1) for c, u in zip(curves, us, strict=True)])
    tangents = SE2(0.0, 0.0, frame.theta).transform(ways)
    tangents /= np.hypot(*tangents.T)[:, None] + 1e-300
    starts = np.concatenate(([0], np.cumsum([len(u) for u in us])))
    found, u_map = np.empty(len(points), np.int64), np.zeros(len(points))
    match_points(
        curve_map.arrays,
        curve_map.matrix,
        step,
        frame.transform(points),
        tangents,
        starts,
        VOTE_REACH * step,
        found,
        u_map,
    )
    for curve, u, (a, b) in zip(curves, us, pairwise(starts), strict=True):
        _count_votes(pairs, curve, u, found[a:b], u_map[a:b])
    return pairs


def _votes_at(curve: Curve) -> Vector:
    start, end = curve.tau_start_m / curve.knot_step_m, curve.tau_end_m / curve.knot_step_m
    count = max(FEWEST_VOTES, round(VOTES_PER_STEP * (end - start)))
    return start + (end - start) * (np.arange(count) + 0.5) / count


def _count_votes(
    pairs: CurvePairs, curve: Curve, u: Vector, found: NDArray[np.int64], u_map: Vector
) -> None:
    """A pair for each map curve on whose lattice enough samples agree about the offset."""
    for map_curve in np.unique(found[found >= 0]):
        at = found == map_curve
        offsets = u_map[at] - u[at]
        agreed = np.abs(offsets - _peak(offsets)) <= 1.0
        if agreed.sum() >= FEWEST_VOTES:
            part = u[at][agreed]
            half = 0.5 / VOTES_PER_STEP
            support = (float(part[0]) - half, float(part[-1]) + half)
            pairs.add(curve, support, int(map_curve), float(np.median(offsets[agreed])))


def _peak(offsets: Vector) -> float:
    """Middle of the fullest bin of one knot step, and its neighbours' share."""
    ordered = np.sort(offsets)
    reach = np.searchsorted(ordered, ordered + 1.0, side="right") - np.arange(len(ordered))
    first = int(reach.argmax())
    return float(np.median(ordered[first : first + reach[first]]))
