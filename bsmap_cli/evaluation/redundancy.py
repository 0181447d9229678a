"""How much of a map is drawn twice."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.near_pairs import Cells, Pairs, places_near, sort_into_cells
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.map_document import PORTION, LevelSamples, MapLevel
from bsmap_cli.mapping.sampling import sample_level

SAMPLES_PER_STEP = 4
REACH = 0.5  # [knot steps] between a sample and the curve that covers it
LONGER = 0.02  # than a quarter of a knot step may a part be: curves have about unit speed
ELSEWHERE = 10.0  # [knot steps] between the places of two curves: apart
APART = 2.0  # [knot steps] in tau from which on a curve may cover itself
COS_TURN = math.cos(math.radians(30.0))


def redundancy(level: MapLevel, samples: LevelSamples | None = None) -> float:
    """All samples over those that no other pass covers; 1 where nothing is drawn twice.

    Samples stand every quarter of a knot step. One is covered where another curve, or the same
    one more than two knot steps away in tau, passes within half a knot step in a direction within
    30 degrees and has a higher (mean weight there, -curve_id). `samples` saves sampling again.
    """
    if samples is not None or len(level.weights) <= 2 * PORTION:
        found, left = _tally(level, samples)
    else:
        tallies = [_tally(part, None, tile) for part, tile in _tiles(level)]
        found, left = (sum(column) for column in zip(*tallies, strict=True))
    # of two passes one is the heavier: some sample is always left
    return found / left if found else 1.0


def _tally(
    level: MapLevel, samples: LevelSamples | None, tile: Points | None = None
) -> tuple[int, int]:
    """How many samples there are within a tile (its two corners), and how many are uncovered."""
    if samples is None:
        samples = sample_level(level, level.knot_step_m / SAMPLES_PER_STEP)
    covered = covered_samples(samples, level.curve_ids.astype(np.int64), level.knot_step_m)
    if tile is not None:
        within = (samples.points >= tile[0]) & (samples.points < tile[1])
        covered = covered[within.all(axis=1)]
    return len(covered), int(np.count_nonzero(~covered))


def _tiles(level: MapLevel) -> Iterator[tuple[MapLevel, Points]]:
    """The level in tiles of some control points each, with all curves that may reach into one."""
    firsts = level.offsets()[:-1]
    low = np.minimum.reduceat(level.control_points, firsts, axis=0) - level.knot_step_m
    high = np.maximum.reduceat(level.control_points, firsts, axis=0) + level.knot_step_m
    side = math.ceil(math.sqrt(len(level.weights) / PORTION))
    lines = np.linspace(low.min(axis=0), high.max(axis=0), side + 1)
    for column in range(side):
        for row in range(side):
            begin = np.array([lines[column, 0], lines[row, 1]])
            end = np.array([lines[column + 1, 0], lines[row + 1, 1]])
            kept = np.asarray(((high >= begin) & (low <= end)).all(axis=1))
            if kept.any():
                yield level.only(kept), np.array([begin, end])


def covered_samples(
    samples: LevelSamples, curve_ids: NDArray[np.int64], knot_step_m: float
) -> NDArray[np.bool_]:
    """(S,) bool: the samples that another, heavier pass of a curve covers."""
    if not len(samples.tau_m):
        return np.zeros(0, bool)
    first = np.flatnonzero(np.diff(samples.piece) == 0)  # segments between neighbouring samples
    chord = samples.points[first + 1] - samples.points[first]
    length = np.hypot(chord[:, 0], chord[:, 1])
    middles, segment = _parts(samples, first, chord, length, knot_step_m)
    reach_m = (REACH + 0.5 * (1.0 + LONGER) / SAMPLES_PER_STEP) * knot_step_m
    cells = sort_into_cells(middles, reach_m, samples.points)
    covered = np.zeros(len(samples.tau_m), bool)
    met = _met(samples, first[segment], cells, knot_step_m)
    for rows in cells.blocks(met):
        near, part = cells.pairs(samples.points[rows])
        pairs = rows[near], segment[part]
        covered[_covered(samples, curve_ids, knot_step_m, first, chord, length, pairs)] = True
    return covered


def _met(
    samples: LevelSamples, other: NDArray[np.int64], cells: Cells, knot_step_m: float
) -> NDArray[np.int64]:
    """The samples that have anything near but their own surroundings: in most maps, few.

    other : the sample at which each of the points in the cells begins.
    """
    ahead_m = np.diff(samples.tau_m)
    ahead_m[np.diff(samples.curve) != 0] = ELSEWHERE * knot_step_m
    places = np.concatenate(([0.0], np.cumsum(ahead_m)))  # along all curves, laid end to end
    near = places_near(cells, places[other], samples.points)
    # a little less than apart: the sum has been rounded
    apart_m = 0.99 * APART * knot_step_m
    return np.flatnonzero((places - near[0] > apart_m) | (near[1] - places > apart_m))


def _covered(
    samples: LevelSamples,
    curve_ids: NDArray[np.int64],
    knot_step_m: float,
    first: NDArray[np.int64],
    chord: Points,
    length: Vector,
    pairs: Pairs,
) -> NDArray[np.int64]:
    """The samples among pairs of samples and segments that are covered by their segment."""
    sample, segment = pairs
    weight, ids = samples.weight, curve_ids[samples.curve]

    # cheap conditions first: each leaves fewer pairs to the next
    other = first[segment]
    apart = np.abs(samples.tau_m[sample] - samples.tau_m[other]) > APART * knot_step_m
    apart |= samples.curve[sample] != samples.curve[other]
    heavy = np.maximum(weight[other], weight[other + 1]) >= weight[sample]
    keep = np.flatnonzero(apart & heavy)
    sample, segment = sample[keep], segment[keep]
    along = (samples.tangents[sample] * chord[segment]).sum(axis=1)
    keep = np.flatnonzero(along >= COS_TURN * length[segment])
    sample, segment = sample[keep], segment[keep]

    other = first[segment]
    offset, way = samples.points[sample] - samples.points[other], chord[segment]
    square = np.maximum(length[segment] ** 2, 1e-300)
    f = np.clip((offset * way).sum(axis=1) / square, 0.0, 1.0)
    off = offset - f[:, None] * way
    there = weight[other] + f * (weight[other + 1] - weight[other])
    heavier = (there > weight[sample]) | ((there == weight[sample]) & (ids[other] < ids[sample]))
    return np.asarray(sample[heavier & (np.hypot(off[:, 0], off[:, 1]) <= REACH * knot_step_m)])


def _parts(
    samples: LevelSamples,
    first: NDArray[np.int64],
    chord: Points,
    length: Vector,
    knot_step_m: float,
) -> tuple[Points, NDArray[np.int64]]:
    """Middles of all segments, and their numbers; segments that are long count in parts."""
    part_m = knot_step_m / SAMPLES_PER_STEP
    parts = np.maximum(np.ceil(length / part_m - LONGER), 1).astype(np.int64)
    segment = np.repeat(np.arange(len(parts)), parts)
    number = np.arange(len(segment)) - np.repeat(np.cumsum(parts) - parts, parts)
    share = (number + 0.5) / parts[segment]
    return samples.points[first[segment]] + share[:, None] * chord[segment], segment
