"""Which map curve a cluster belongs to: Sec. III-B, eqs. (4)(5)."""

from __future__ import annotations

from dataclasses import dataclass

from bsmap_cli.settings import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class AssociationSettings:
    """How far a scan may lie from the curve it belongs to."""

    method: str = setting("curve", "match points to curves, or centroids of clusters between scans", choices=("curve", "centroid"))
    track_dist: float = setting(1.0, "greatest distance between a match and its partner [knot steps]", symbol="gamma_track", minimum=0.0)
