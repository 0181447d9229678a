"""Fit a curve to a cluster: Sec. III-C, eqs. (6)-(8)."""

from __future__ import annotations

from dataclasses import dataclass

from bsmap_cli.settings import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class FittingSettings:
    """How points become a curve."""

    parameters: str = setting("arc", "curve parameter of a point: arc length of a smooth first fit, or the chord length of eq. (7)", choices=("arc", "chord"))
    penalty: float = setting(1e-3, "on third differences of the control points, relative to the data of one span", minimum=0.0)
    first_penalty: float = setting(2e-2, "the same, for the fit that gives the arc length", minimum=0.0)
    thinning: float = setting(0.2, "points are averaged into bins of this length [knot steps]", minimum=0.0)
