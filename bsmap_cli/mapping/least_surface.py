"""How much of a surface must be seen to count: gamma_min of Sec. III-A, and a length."""

from __future__ import annotations

from typing import NamedTuple

from bsmap_cli.geometry.compiled import inlined


class LeastSurface(NamedTuple):
    """The least that counts: so many points over such a length, or fewer over a longer one."""

    points: int
    length_m: float
    faint_points: int
    faint_length_m: float


@inlined
def is_surface(points: int, length_m: float, least: LeastSurface) -> bool:
    """Do so many points over such a length show a surface?"""
    return (points >= least.points and length_m >= least.length_m) or (
        points >= least.faint_points and length_m >= least.faint_length_m
    )
