"""Extend and average map curves: Sec. III-D, eqs. (12)(13) and Table I."""

from __future__ import annotations

from dataclasses import dataclass

from bsmap_cli.settings import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class MergingSettings:
    """How new curves enter the map."""

    method: str = setting("fractional", "weigh control points by the data under their basis function, or Table I as printed", choices=("fractional", "table"))
    max_weight: int = setting(50, "a control point counts at most so many observations", symbol="gamma_weight", minimum=1, maximum=255)
