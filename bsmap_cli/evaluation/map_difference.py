"""What differs between two maps of one place: which stretches of curves only one of them has.

Of what the later map lacks, its path and its curves tell what it looked through, and what it may
just not have seen.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.evaluation.occupancy import FREE, grid_frame, occupancy
from bsmap_cli.geometry.near_pairs import Pairs, sort_into_cells
from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.mapping.map_document import LevelSamples, MapDocument
from bsmap_cli.mapping.sampling import sample_level

SAMPLES_PER_STEP = 4
SAME_WAY = 0.5  # cosine: curves that run within 60 degrees show the same face of a wall
SHORTEST = 3.0  # a shorter stretch tells of noise, not of a change [tolerances]
CELL_M = 0.05  # of the grid that tells what was looked through
MOST_CELLS = 2**24  # of it: larger maps get larger cells
DIGITS = 4  # of coordinates in a report: 0.1 mm


@dataclass(frozen=True, slots=True)
class Stretch:
    """A part of a curve that the other map does not have; (n, 2) points in the frame of A.

    change : "added", of B; "removed" or "unseen", of A.
    """

    change: str
    length_m: float
    curve_id: int
    points: Points


@dataclass(frozen=True, slots=True, kw_only=True)
class MapDifference:
    """Metres of curves, and where they are.

    added_m : of B, where A has none; removed_m : of A, where B has none and looked through;
    unseen_m : of A, where B has none and nothing tells that it looked; common_m : the rest of A.
    rms_m : distance of B from A where both have a curve, 0 where they share none.
    """

    pose_a_b: SE2
    tolerance_m: float
    added_m: float
    removed_m: float
    unseen_m: float
    common_m: float
    rms_m: float
    segments: tuple[Stretch, ...]

    def as_json(self) -> dict[str, Any]:
        """The report."""
        pose = (self.pose_a_b.x, self.pose_a_b.y, float(np.degrees(self.pose_a_b.theta)))
        return {
            "added_m": round(self.added_m, DIGITS),
            "removed_m": round(self.removed_m, DIGITS),
            "unseen_m": round(self.unseen_m, DIGITS),
            "common_m": round(self.common_m, DIGITS),
            "rms_m": round(self.rms_m, 6),
            "segments": [
                {
                    "change": stretch.change,
                    "length_m": round(stretch.length_m, DIGITS),
                    "curve_id": stretch.curve_id,
                    "points": np.round(stretch.points, DIGITS).tolist(),
                }
                for stretch in self.segments
            ],
            "at": [round(value, 6) for value in pose],
            "tolerance_m": self.tolerance_m,
        }


@dataclass(frozen=True, slots=True)
class _Sampled:
    """Samples of all levels that make up one map, in one frame; piece counts through them all."""

    points: Points
    tangents: Points
    piece: NDArray[np.int64]
    curve_id: NDArray[np.int64]


def map_difference(
    a: MapDocument, b: MapDocument, pose_a_b: SE2, *, tolerance_m: float | None = None
) -> MapDifference:
    """Compare the drawn curves of two maps.

    tolerance_m : a curve of the other map that passes so near, and runs the same way, is the
    same; None: the wider one of the knot steps. Stretches shorter than three times that are
    left out.
    """
    level_a, level_b = a.chosen_levels(), b.chosen_levels()
    steps = [level.knot_step_m for level in (*level_a, *level_b)]
    tolerance = max(steps) if tolerance_m is None else tolerance_m
    spacing_m = min(*steps, tolerance) / SAMPLES_PER_STEP
    ours = _sampled([sample_level(level, spacing_m) for level in level_a], level_a)
    theirs = _sampled([sample_level(level, spacing_m) for level in level_b], level_b)
    turn = SE2(0.0, 0.0, pose_a_b.theta)
    theirs = _Sampled(
        pose_a_b.transform(theirs.points),
        turn.transform(theirs.tangents),
        theirs.piece,
        theirs.curve_id,
    )
    lacking = ~np.isfinite(_aside(ours, theirs, tolerance))
    aside = _aside(theirs, ours, tolerance)
    met = np.isfinite(aside)
    shortest_m = SHORTEST * tolerance
    added = _stretches(theirs, ~met, "added", shortest_m)
    lost = _stretches(ours, lacking, "unseen", shortest_m)
    sight = _Sight(b, pose_a_b)
    told = [part for stretch in lost for part in _told_apart(stretch, sight, shortest_m)]
    changes = (*added, *told)
    removed_m, unseen_m = _total(told, "removed"), _total(told, "unseen")
    return MapDifference(
        pose_a_b=pose_a_b,
        tolerance_m=tolerance,
        added_m=_total(added, "added"),
        removed_m=removed_m,
        unseen_m=unseen_m,
        common_m=float(_lengths(ours).sum()) - removed_m - unseen_m,
        rms_m=float(np.sqrt(np.mean(aside[met] ** 2))) if met.any() else 0.0,
        segments=tuple(sorted(changes, key=lambda stretch: -stretch.length_m)),
    )


def _sampled(samples: Sequence[LevelSamples], levels: Sequence[Any]) -> _Sampled:
    pieces, first = [], 0
    for part in samples:
        pieces.append(part.piece + first)
        first += int(part.piece.max(initial=-1)) + 1
    ids = [level.curve_ids[part.curve] for part, level in zip(samples, levels, strict=True)]
    return _Sampled(
        np.concatenate([part.points for part in samples]),
        np.concatenate([part.tangents for part in samples]),
        np.concatenate(pieces),
        np.concatenate(ids).astype(np.int64),
    )


def _aside(samples: _Sampled, others: _Sampled, tolerance_m: float) -> Vector:
    """(n,) distance [m] of each sample from the nearest curve that runs its way; inf: none near.

    A curve is taken for straight next to its nearest sample, and to end half a spacing behind.
    """
    aside = np.full(len(samples.points), np.inf)
    if not len(samples.points) or not len(others.points):
        return aside
    cells = sort_into_cells(others.points, tolerance_m, samples.points)
    for rows in cells.blocks(np.arange(len(aside))):
        near, other = cells.pairs(samples.points[rows])
        found, across = _nearest_aside(samples, others, (rows[near], other), tolerance_m)
        aside[found] = across
    return aside


def _nearest_aside(
    samples: _Sampled, others: _Sampled, pairs: Pairs, tolerance_m: float
) -> tuple[NDArray[np.int64], Vector]:
    """The samples that are near another that runs their way, and how far off they are."""
    sample, other = pairs
    same_way = (samples.tangents[sample] * others.tangents[other]).sum(axis=1) >= SAME_WAY
    sample, other = sample[same_way], other[same_way]
    gap = samples.points[sample] - others.points[other]
    distance = np.hypot(gap[:, 0], gap[:, 1])
    order = np.lexsort((distance, sample))
    order = order[distance[order] <= tolerance_m]
    _, first = np.unique(sample[order], return_index=True)
    nearest = order[first]
    tangent = others.tangents[other[nearest]]
    across = gap[nearest, 0] * tangent[:, 1] - gap[nearest, 1] * tangent[:, 0]
    return sample[nearest], np.abs(across)


def _lengths(samples: _Sampled) -> Vector:
    """(n - 1,) way [m] from each sample to the next of its piece, 0 to another piece."""
    step = np.diff(samples.points, axis=0)
    within = np.diff(samples.piece) == 0
    length: Vector = np.hypot(step[:, 0], step[:, 1]) * within
    return length


def _stretches(
    samples: _Sampled, alone: NDArray[np.bool_], change: str, shortest_m: float
) -> list[Stretch]:
    """Runs of samples that are alone, in one piece, and long enough."""
    length = np.concatenate((_lengths(samples), [0.0]))
    marked = np.concatenate(([False], alone, [False]))
    cut = np.concatenate(([True], np.diff(samples.piece) != 0, [True]))
    begins = np.flatnonzero(marked[1:-1] & (~marked[:-2] | cut[:-1]))
    ends = np.flatnonzero(marked[1:-1] & (~marked[2:] | cut[1:])) + 1
    found = []
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        way_m = float(length[begin : end - 1].sum())
        if way_m >= shortest_m:
            curve_id = int(samples.curve_id[begin])
            found.append(Stretch(change, way_m, curve_id, samples.points[begin:end]))
    return found


class _Sight:
    """What a map looked through: free cells between its path and the surfaces it shows."""

    def __init__(self, document: MapDocument, pose_a_b: SE2) -> None:
        self._pose_b_a = pose_a_b.inverse()
        levels, path = document.chosen_levels(), document.path[:, :2].astype(np.float64)
        rough = [sample_level(level, level.knot_step_m).points for level in levels]
        cells = grid_frame(np.concatenate(rough), CELL_M).cells
        cell_m = CELL_M * max(1.0, float(np.sqrt(cells / MOST_CELLS)))
        self._grid = occupancy(levels, path, resolution_m=cell_m)

    def through(self, points: Points) -> NDArray[np.bool_]:
        """(n,) bool: which points, in the frame of A, lie in free space."""
        frame = self._grid.frame
        places = frame.in_cells(self._pose_b_a.transform(points))
        column, row = np.floor(places).astype(np.int64).T
        inside = (column >= 0) & (column < frame.columns) & (row >= 0) & (row < frame.rows)
        free = np.zeros(len(points), bool)
        free[inside] = self._grid.cells[row[inside], column[inside]] == FREE
        return free


def _told_apart(stretch: Stretch, sight: _Sight, shortest_m: float) -> Iterator[Stretch]:
    """The parts of a stretch that are removed and unseen; short ones go with the one before."""
    through = sight.through(stretch.points)
    way_m = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(stretch.points, axis=0).T))))
    begin, last = 0, len(through) - 1
    changes = np.flatnonzero(np.diff(through)) + 1
    ends = [row for row in changes.tolist() if way_m[last] - way_m[row] >= shortest_m]
    for end in [*ends, last]:
        if way_m[end] - way_m[begin] < shortest_m and end < last:
            continue
        is_through = 2 * int(through[begin : end + 1].sum()) > end + 1 - begin
        yield replace(
            stretch,
            change="removed" if is_through else "unseen",
            length_m=float(way_m[end] - way_m[begin]),
            points=stretch.points[begin : end + 1],
        )
        begin = end


def _total(stretches: Sequence[Stretch], change: str) -> float:
    return sum((stretch.length_m for stretch in stretches if stretch.change == change), 0.0)
