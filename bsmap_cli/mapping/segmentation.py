"""Divide a scan into clusters: Sec. III-A, eq. (3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import kernel, lean
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.continuity import BEAM_GAPS, GapRule, cut_surfaces
from bsmap_cli.mapping.least_surface import LeastSurface
from bsmap_cli.sensor.gate import STANDING, Fan, gather
from bsmap_cli.sensor.scan import Ranges
from bsmap_cli.settings import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentationSettings:
    """Where one surface ends and the next begins."""

    rel_gap: float = setting(
        3.0, "a gap this many times the one before ends a cluster", symbol="gamma_rel", minimum=1.0
    )
    max_gap: float = setting(
        0.7,
        "a longer gap ends a cluster [knot steps]; never less than what the beam spacing explains",
        symbol="gamma_abs",
        minimum=0.0,
    )
    min_points: int = setting(5, "smaller clusters are not drawn", symbol="gamma_min", minimum=2)
    faint_points: int = setting(
        3,
        "SLAM is guided by smaller clusters too, down to this size, and leaves them out of the "
        "finished map; with final_map.rebuild=false they are drawn too",
        minimum=2,
    )
    faint_length: float = setting(2.0, "these must be at least so long [knot steps]", minimum=0.0)
    min_length: float = setting(0.75, "shorter clusters are dropped [knot steps]", minimum=0.0)
    beam_gap: bool = setting(
        True,
        "widen max_gap where beams lie far apart or are noisy, and pass over lone beams that are "
        "lost or astray; off: the constant of eq. (3)",
    )
    each_level: bool = setting(
        False, "segment anew for each knot step; off: once at the finest, and widen the bins"
    )

    def least(self, knot_step_m: float) -> LeastSurface:
        """What counts as a surface at one knot step."""
        return LeastSurface(
            self.min_points,
            self.min_length * knot_step_m,
            min(self.faint_points, self.min_points),
            self.faint_length * knot_step_m,
        )


@dataclass(frozen=True, slots=True)
class Clusters:
    """The clusters of one scan at one knot step, thinned, one after the other in beam order.

    points : (n, 2) float64 [m]; tangents : (n, 2) unit vectors in beam order; counts : (n,) raw
    returns behind each point; starts : (c + 1,) first point of each cluster, and the end.
    """

    points: Points
    tangents: Points
    counts: Vector
    starts: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.starts) - 1

    def coarser(self, knot_step_m: float, bin_m: float, sigma_m: float) -> Clusters:
        """The same clusters in wider bins, as a coarser level of the ladder sees them."""
        n = len(self.points)
        points, counts, starts = np.empty((n, 2)), np.empty(n), np.empty_like(self.starts)
        m = _thin(self.points, self.counts, self.starts, bin_m, points, counts, starts)
        return Clusters.with_tangents(points[:m], counts[:m], starts, knot_step_m, sigma_m)

    @classmethod
    def with_tangents(
        cls,
        points: Points,
        counts: Vector,
        starts: NDArray[np.int64],
        knot_step_m: float,
        sigma_m: float,
    ) -> Clusters:
        """Add the direction of the surface."""
        tangents = np.empty_like(points)
        _tangents(points, starts, _reach_m(knot_step_m, sigma_m), tangents)
        return cls(points, tangents, counts, starts)


def _reach_m(knot_step_m: float, sigma_m: float) -> float:
    """Over how much of a surface its direction is taken: well beyond the noise."""
    return max(0.5 * knot_step_m, 6.0 * sigma_m)


@lean
def _thin(
    points: Points,
    returns: Vector,
    bounds: NDArray[np.int64],
    bin_m: float,
    thinned: Points,
    counts: Vector,
    starts: NDArray[np.int64],
) -> int:
    """Average neighbours of a cluster that lie within one bin; the number of points left.

    bounds, starts : first point of each cluster, and the end, before and after.
    """
    n = 0
    for c in range(len(bounds) - 1):
        starts[c] = n
        i = bounds[c]
        while i < bounds[c + 1]:
            x = y = total = 0.0
            first = i
            while i < bounds[c + 1]:
                ahead_x, ahead_y = points[i, 0] - points[first, 0], points[i, 1] - points[first, 1]
                if i > first and ahead_x * ahead_x + ahead_y * ahead_y >= bin_m * bin_m:
                    break
                x += returns[i] * points[i, 0]
                y += returns[i] * points[i, 1]
                total += returns[i]
                i += 1
            counts[n] = total
            thinned[n, 0] = x / total
            thinned[n, 1] = y / total
            n += 1
    starts[len(bounds) - 1] = n
    return n


@lean
def _tangents(points: Points, starts: NDArray[np.int64], reach_m: float, tangents: Points) -> None:
    """Direction of the surface at each point, over neighbours at least `reach_m` away."""
    for c in range(len(starts) - 1):
        low, high = starts[c], starts[c + 1] - 1
        for i in range(low, high + 1):
            a = b = i
            dx = dy = 0.0
            while dx * dx + dy * dy < reach_m * reach_m and (a > low or b < high):
                a = max(low, a - 1)
                b = min(high, b + 1)
                dx = points[b, 0] - points[a, 0]
                dy = points[b, 1] - points[a, 1]
            norm = math.sqrt(dx * dx + dy * dy) + 1e-300
            tangents[i, 0] = dx / norm
            tangents[i, 1] = dy / norm


@kernel
def _see(
    ranges: Ranges,
    beam_fan: tuple[Any, ...],
    twist_body: Vector,
    gap_rule: tuple[Any, ...],
    least_surface: tuple[Any, ...],
    bin_m: float,
    reach_m: float,
    thinned: Points,
    tangents: Points,
    counts: Vector,
    starts: NDArray[np.int64],
) -> tuple[int, int]:
    """Write the clusters of a scan; the number of their points, and of themselves.

    Fan, rule and least surface come as plain tuples, which are handed over three times as fast.
    """
    rule, least = GapRule(*gap_rule), LeastSurface(*least_surface)
    beams = len(ranges)
    points, lengths, returned = np.empty((beams, 2)), np.empty(beams), np.empty(beams, np.int64)
    m = gather(ranges, Fan(*beam_fan), twist_body, points, lengths, returned)
    if rule.beam_gap_rad == 0.0:  # eq. (3) knows no beams that tell nothing
        for i in range(m):
            returned[i] = i
    kept, bounds = np.empty((m, 2)), np.empty(m + 1, np.int64)
    clusters = cut_surfaces(points[:m], lengths[:m], returned[:m], rule, least, kept, bounds)
    n = _thin(kept, np.ones(m), bounds[: clusters + 1], bin_m, thinned, counts, starts)
    _tangents(thinned, starts[: clusters + 1], reach_m, tangents)
    return n, clusters


class SegmentationRule(NamedTuple):
    """All that tells how a scan is cut but the scan: made once for a lidar and its noise.

    fan, gap_rule, least : `Fan`, `GapRule` and `LeastSurface` as plain tuples.
    """

    fan: tuple[Any, ...]
    gap_rule: tuple[Any, ...]
    least: tuple[Any, ...]
    bin_m: float
    reach_m: float


def segmentation_rule(
    fan: Fan, settings: SegmentationSettings, *, knot_step_m: float, bin_m: float, sigma_m: float
) -> SegmentationRule:
    """For scans of a fan whose ranges err by `sigma_m`, thinned into bins of `bin_m`."""
    gap_rule = GapRule(
        max_gap_m=settings.max_gap * knot_step_m,
        rel_gap=settings.rel_gap,
        beam_gap_rad=BEAM_GAPS * fan.beam_step_rad if settings.beam_gap else 0.0,
        sigma_m=sigma_m if settings.beam_gap else 0.0,
        fewest=settings.min_points,
    )
    least = settings.least(knot_step_m)
    reach_m = _reach_m(knot_step_m, sigma_m)
    return SegmentationRule(tuple(fan), tuple(gap_rule), tuple(least), bin_m, reach_m)


def find_clusters(
    ranges_m: Ranges, rule: SegmentationRule, twist_body: Vector = STANDING
) -> Clusters:
    """Cut the returns where the surface ends, eq. (3), and thin each cluster into bins.

    ranges_m : (n,) of all beams of the rule's fan. twist_body : (3,) vx, vy [m/s], omega [rad/s]
    of the base, to undo the motion of the sweep.
    """
    beams = len(ranges_m)
    points, tangents, counts = np.empty((beams, 2)), np.empty((beams, 2)), np.empty(beams)
    starts = np.empty(beams + 1, np.int64)
    fan, gap_rule, least, bin_m, reach_m = rule
    n, clusters = _see(
        ranges_m,
        fan,
        twist_body,
        gap_rule,
        least,
        bin_m,
        reach_m,
        points,
        tangents,
        counts,
        starts,
    )
    return Clusters(points[:n], tangents[:n], counts[:n], starts[: clusters + 1])
