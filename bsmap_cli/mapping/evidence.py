"""Remove what the world no longer shows: hits and misses of all views, weighed in order of time.

Each span has a score: up by one for a view that hits it, down by one for a view that looks
through it. It is bounded above, so that what has gone goes from the map after a few misses however
often it was hit before, and farther below, so that what passes through a place that was long seen
empty leaves no trace, but what came to stay does.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import lean
from bsmap_cli.geometry.se2 import Vector
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.trimming import remove_points
from bsmap_cli.mapping.visibility import DARK, HIT, MISS, Look, look_at
from bsmap_cli.sensor.sight import Sight
from bsmap_cli.settings import setting

ABSENT = -1.0  # where the score of a span and its neighbours ends here or below, it is not there
NEIGHBOURS = 2  # spans to either side that are judged together
DARK_MISS = 0.5  # nothing returned: a miss, or a surface that does not return every beam
DARK_COSINE, DARK_RANGE = 0.5, 0.95  # where it counts at all against what was hardly ever hit

Flags = NDArray[np.bool_]
View = tuple[Sight, Vector]
"""What a scan looked through, and the pose (3,) of its base in the map."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VisibilitySettings:
    """What becomes of curves that later scans look through."""

    method: str = setting(
        "evidence",
        "weigh all views when the map is finished; lower weights by each miss as scans come "
        "(a map that is built anew weighs all views then, too); keep all",
        choices=("evidence", "fade", "off"),
    )
    leaving: float = setting(
        10.0, "misses in a row after which what was surely there has gone", minimum=1.0
    )
    arriving: float = setting(
        40.0, "hits in a row after which what was surely not there stands", minimum=1.0
    )
    tentative: int = setting(
        3, "what fewer views have hit is contradicted by any view, else by similar ones", minimum=0
    )


class Tally(NamedTuple):
    """What is known of each span, by row.

    score : see above; hits : views that hit it; least_cosine, farthest_m : the flattest incidence
    and the longest beam among these.
    """

    score: Vector
    hits: Vector
    least_cosine: Vector
    farthest_m: Vector


def remove_unseen(
    curve_map: CurveMap,
    views: Sequence[View],
    *,
    sigma_m: float,
    settings: VisibilitySettings,
    min_length: float,
    old_curves: int = 0,
) -> None:
    """Remove the parts of curves that the views, in order of time, contradict.

    A control point goes when all spans that it shapes are absent. `min_length` : what is left of
    a curve and shorter goes too [knot steps]. old_curves : so many, the first ones, come from a
    map that was there before: their weights tell of views that are not among these.
    """
    arrays = curve_map.arrays
    rows = int(arrays.sizes[1])
    tally = Tally(np.zeros(rows), np.zeros(rows), np.full(rows, math.inf), np.zeros(rows))
    looks = []
    for sight, pose in views:
        look = look_at(curve_map, sight, pose, sigma_m)
        _count_hits(look, tally)
        looks.append(look)
    _recall(arrays, curve_map.degree, old_curves, settings.leaving, tally)
    for look in looks:
        _weigh(look, tally, settings.leaving, settings.arriving, settings.tentative)
    absent, gone = np.zeros(rows, bool), np.zeros(rows, bool)
    _find_absent(arrays, curve_map.degree, tally.score, settings.leaving, absent)
    if _gone_points(arrays, curve_map.degree, absent, gone):
        remove_points(curve_map, gone, min_length=min_length)


@lean
def _recall(level: LevelArrays, degree: int, curves: int, leaving: float, tally: Tally) -> None:
    """Count the views that made old curves: what their weights hold beyond the hits known."""
    for curve in range(curves):
        offset = level.offset[curve]
        for row in range(offset, offset + level.count[curve] - degree):
            lightest = math.inf
            for k in range(row, row + degree + 1):
                lightest = min(lightest, level.weights[k])
            earlier = lightest - tally.hits[row]
            if earlier < 1.0:
                continue
            tally.score[row] = min(leaving, earlier)
            if tally.hits[row] == 0.0:  # from where it was seen is not known any more
                tally.least_cosine[row], tally.farthest_m[row] = 0.0, math.inf
            tally.hits[row] += earlier


@lean
def _count_hits(look: Look, tally: Tally) -> None:
    """From where each span returns a beam: a glass pane does so only along its normal."""
    for i in range(len(look.rows)):
        if look.verdicts[i] == HIT:
            row = look.rows[i]
            tally.hits[row] += 1.0
            tally.least_cosine[row] = min(tally.least_cosine[row], look.cosines[i])
            tally.farthest_m[row] = max(tally.farthest_m[row], look.ranges_m[i])


@lean
def _weigh(look: Look, tally: Tally, leaving: float, arriving: float, tentative: int) -> None:
    """Let one view change the scores."""
    for i in range(len(look.rows)):
        row, verdict = look.rows[i], look.verdicts[i]
        if verdict == HIT:
            tally.score[row] = min(leaving, tally.score[row] + 1.0)
            continue
        cosine, r = look.cosines[i], look.ranges_m[i]
        counts = cosine >= tally.least_cosine[row] and r <= tally.farthest_m[row]
        if tally.hits[row] < tentative:
            sure = cosine >= DARK_COSINE and r <= DARK_RANGE * look.reach_m
            counts = counts or verdict == MISS or sure
        if counts:
            miss = DARK_MISS if verdict == DARK else 1.0
            tally.score[row] = max(-arriving, tally.score[row] - miss)


@lean
def _find_absent(
    level: LevelArrays, degree: int, score: Vector, leaving: float, absent: Flags
) -> None:
    """Mark the spans that are surely not there, or not by the scores round them.

    What is seen from few places alone goes with what it is a part of, and a wall stays up to
    where a door that has opened began: none counts more than surely there or surely not.
    """
    for curve in range(level.sizes[0]):
        first = level.offset[curve]
        end = first + level.count[curve] - degree
        for row in range(first, end):
            total = 0.0
            for other in range(max(first, row - NEIGHBOURS), min(end, row + NEIGHBOURS + 1)):
                total += max(-leaving, score[other])
            judged = score[row] <= -leaving or total <= ABSENT
            absent[row] = judged and level.span_cell[row] >= 0


@lean
def _gone_points(level: LevelArrays, degree: int, absent: Flags, gone: Flags) -> bool:
    """Mark the control points all of whose spans are absent, or not indexed; is there any?"""
    found = False
    for curve in range(level.sizes[0]):
        offset, count = level.offset[curve], level.count[curve]
        last = offset + count - degree - 1
        for row in range(offset, offset + count):
            contradicted = False
            kept = False
            for span in range(max(offset, row - degree), min(last, row) + 1):
                if absent[span]:
                    contradicted = True
                elif level.span_cell[span] >= 0:
                    kept = True
            gone[row] = contradicted and not kept
            found = found or gone[row]
    return found
