"""Where one surface goes on and where the next begins: eq. (3), past beams that tell nothing.

A beam may return nothing, or stray: it lies far from both its neighbours, which go on as one
surface. Neither says that the surface ends. How many are lost in a row by chance, the scan tells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, lean
from bsmap_cli.geometry.kernels import magnitude
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.least_surface import LeastSurface, is_surface

BEAM_GAPS = 3.0  # neighbours on one surface, seen under 70 degrees from its normal, in beam steps
NOISE_GAPS = 4.0  # the relative test of eq. (3) counts smaller gaps as this many sigma
SCANS = 10  # in so many, chance cuts one surface
MOST_LOST = 0.9  # of the beams: a scan of lone points is no scan of surfaces
SAME_WAY = 0.5  # cosine: a gap runs along the surface beside it, or across it
UNSEEN = -2.0  # no cosine

Integers = NDArray[np.int64]


class GapRule(NamedTuple):
    """What counts as one surface.

    max_gap_m, rel_gap : gamma_abs and gamma_rel of eq. (3). beam_gap_rad : the longest gap that
    beam spacing explains, over the range; 0: eq. (3) alone, as in the paper. sigma_m : range noise.
    fewest : returns that make a cluster; fewer may stray in a row.
    """

    max_gap_m: float
    rel_gap: float
    beam_gap_rad: float
    sigma_m: float
    fewest: int


@inlined
def _apart_m(points: Points, i: int, j: int) -> float:
    return magnitude(points[j, 0] - points[i, 0], points[j, 1] - points[i, 1])


@inlined
def _seen_along(
    points: Points, i: int, step: int, end: int, reach_m: float, ux: float, uy: float
) -> float:
    """Cosine between the unit vector (ux, uy) and the surface beside point i, in beam order.

    The surface is what lies from i on, in steps of `step` (1 or -1) before `end`, up to `reach_m`
    away; UNSEEN where it is shorter.
    """
    k = i + step
    while k != end:
        dx, dy = step * (points[k, 0] - points[i, 0]), step * (points[k, 1] - points[i, 1])
        length = math.sqrt(dx * dx + dy * dy)
        if length >= reach_m:
            cosine: float = (dx * ux + dy * uy) / length
            return cosine
        k += step
    return UNSEEN


@inlined
def _noise_m(rule: GapRule) -> float:
    """What noise alone may put between two returns of one place."""
    return math.sqrt(2.0) * NOISE_GAPS * rule.sigma_m


@inlined
def _widest_m(ranges: Vector, i: int, j: int, beams_apart: int, rule: GapRule) -> float:
    """The longest gap between returns i and j of one surface."""
    spacing = rule.beam_gap_rad * beams_apart * min(ranges[i], ranges[j])
    noise = _noise_m(rule)
    explained: float = math.sqrt(spacing * spacing + noise * noise)
    return max(rule.max_gap_m, explained)


@inlined
def _spanned(
    points: Points, ranges: Vector, beams: Integers, i: int, j: int, rule: GapRule
) -> bool:
    """Is the gap between i and j no longer than the spacing of so many beams explains?"""
    dx, dy = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
    if dx * dx + dy * dy <= rule.max_gap_m * rule.max_gap_m:  # most are: no need to ask further
        return True
    return magnitude(dx, dy) <= _widest_m(ranges, i, j, beams[j] - beams[i], rule)


@lean
def _longest_loss(points: Points, ranges: Vector, beams: Integers, rule: GapRule) -> int:
    """Beams that are lost in a row once in SCANS, where losses fall by chance.

    Lost are silent beams and single ones that stray, where spacing explains the gap they leave: a
    row of silent beams counts once, as it may be an opening. With a share `lost` of all beams, a
    row of k begins at lost^k of them.
    """
    count = len(ranges)
    lost = 1
    for i in range(1, count):
        if beams[i] - beams[i - 1] > 1:
            lost += _spanned(points, ranges, beams, i - 1, i, rule)
        elif i + 1 < count and not _spanned(points, ranges, beams, i - 1, i, rule):
            lost += not _spanned(points, ranges, beams, i, i + 1, rule) and _spanned(
                points, ranges, beams, i - 1, i + 1, rule
            )
    share = min(lost / max(count, 2), MOST_LOST)
    return math.floor(math.log(SCANS * max(count, 2)) / -math.log(share))


@inlined
def _bridged(
    points: Points, ranges: Vector, beams: Integers, first: int, i: int, j: int, rule: GapRule
) -> bool:
    """Do returns i and j lie on one surface, though the beams between them tell nothing?

    Spacing explains a gap of so many beams; one that is longer than eq. (3) allows must also run
    along the surface on one side of it: across, it is the step from one surface to another. Where
    returns lie between, both sides must say so: they may be of a surface of their own.
    """
    if not _spanned(points, ranges, beams, i, j, rule):
        return False
    gap = _apart_m(points, i, j)
    if gap <= rule.max_gap_m:
        return True
    ux, uy = (points[j, 0] - points[i, 0]) / gap, (points[j, 1] - points[i, 1]) / gap
    reach = max(0.5 * gap, NOISE_GAPS * rule.sigma_m)
    before = _seen_along(points, i, -1, first - 1, reach, ux, uy)
    behind = _seen_along(points, j, 1, len(ranges), reach, ux, uy)
    if j > i + 1 and min(before, behind) > UNSEEN:
        return min(before, behind) >= SAME_WAY
    return max(before, behind) >= SAME_WAY


@inlined
def _adjoin(
    points: Points, ranges: Vector, beams: Integers, i: int, j: int, spacing_m: float, rule: GapRule
) -> bool:
    """Eq. (3) for neighbours i and j, after `spacing_m` from beam to beam on this surface.

    What beam spacing or noise explains is no gap.
    """
    gap = _apart_m(points, i, j)
    before = max(spacing_m * (beams[j] - beams[i]), NOISE_GAPS * rule.sigma_m)
    return gap <= rule.rel_gap * before and (
        gap <= rule.max_gap_m or gap <= _widest_m(ranges, i, j, 1, rule)
    )


@inlined
def _next_return(
    points: Points,
    ranges: Vector,
    beams: Integers,
    first: int,
    last: int,
    i: int,
    spacing_m: float,
    longest: int,
    rule: GapRule,
) -> int:
    """The next return on the surface that goes from `first` to `last`; -1: it ends there.

    That is i, the next of all, or the one behind a few that stray: that lie farther from the
    returns on both sides than those from each other, and than noise explains.
    """
    gap, noise = _apart_m(points, last, i), _noise_m(rule)
    adjoin = _adjoin(points, ranges, beams, last, i, spacing_m, rule)
    if adjoin and gap <= noise:
        return i
    for j in range(i + 1, min(i + rule.fewest, len(ranges))):
        if beams[j] - beams[last] - 1 > longest:
            break
        near = max(noise, _apart_m(points, last, j))
        if min(gap, _apart_m(points, j - 1, j)) > near and _bridged(
            points, ranges, beams, first, last, j, rule
        ):
            return j
    if not adjoin and 0 < beams[i] - beams[last] - 1 <= longest:
        adjoin = _bridged(points, ranges, beams, first, last, i, rule)
    return i if adjoin else -1


@inlined
def _last_strayed(
    points: Points,
    ranges: Vector,
    beams: Integers,
    first: int,
    before: int,
    last: int,
    i: int,
    longest: int,
    rule: GapRule,
) -> bool:
    """Does the surface go on from `before` to i, and only the last return lie too far off?"""
    return (
        beams[i] - beams[before] - 1 <= longest
        and _apart_m(points, before, i) < _apart_m(points, last, i)
        and _bridged(points, ranges, beams, first, before, i, rule)
    )


@lean
def cut_surfaces(
    points: Points,
    ranges: Vector,
    beams: Integers,
    rule: GapRule,
    least: LeastSurface,
    kept: Points,
    bounds: Integers,
) -> int:
    """Write the returns on surfaces to `kept`, first of each surface, and the end, to `bounds`.

    Surfaces of which less is seen than `least` are left out. The number of surfaces.
    """
    count = len(ranges)
    longest = _longest_loss(points, ranges, beams, rule) if rule.beam_gap_rad > 0.0 else 0
    surfaces = start = end = first = last = before = i = 0
    length, spacing, gap = 0.0, math.inf, 0.0
    while i <= count:
        found = -1
        if i < count and end > start:
            found = _next_return(points, ranges, beams, first, last, i, spacing, longest, rule)
            if (
                found < 0
                and end > start + 1
                and _last_strayed(points, ranges, beams, first, before, last, i, longest, rule)
            ):
                found, end, last = i, end - 1, before
                length -= gap
        if found >= 0:
            gap = _apart_m(points, last, found)
            length += gap
            beams_on = beams[found] - beams[last]
            spacing = gap if beams_on == 1 else gap / beams_on
        else:
            if is_surface(end - start, length, least):
                bounds[surfaces] = start
                surfaces += 1
                start = end
            end = start
            first = found = i
            length, spacing, gap = 0.0, math.inf, 0.0
        if found < count:
            kept[end, 0], kept[end, 1] = points[found, 0], points[found, 1]
            before, last = last, found
            end += 1
        i = found + 1
    bounds[surfaces] = start
    return surfaces
