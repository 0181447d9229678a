"""Divide a scan into clusters: Sec. III-A, eq. (3)."""

from __future__ import annotations

from dataclasses import dataclass

from bsmap_cli.settings import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentationSettings:
    """Where one surface ends and the next begins."""

    rel_gap: float = setting(3.0, "a gap this many times the one before it ends a cluster", symbol="gamma_rel", minimum=1.0)
    max_gap: float = setting(0.7, "a longer gap ends a cluster [knot steps]", symbol="gamma_abs", minimum=0.0)
    min_points: int = setting(5, "smaller clusters are dropped", symbol="gamma_min", minimum=2)
    min_length: float = setting(0.75, "shorter clusters are dropped [knot steps]", minimum=0.0)
