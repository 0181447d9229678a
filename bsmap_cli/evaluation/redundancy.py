"""How much of a map is drawn twice."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.map_document import LevelSamples, MapLevel
from bsmap_cli.mapping.sampling import sample_level

SAMPLES_PER_STEP = 4
REACH = 0.5  # [knot steps] between a sample and the curve that covers it
APART = 2.0  # [knot steps] in tau from which on a curve may cover itself
COS_TURN = math.cos(math.radians(30.0))

Pairs = tuple[NDArray[np.int64], NDArray[np.int64]]


def redundancy(level: MapLevel) -> float:
    """All samples over those that no other pass covers; 1 where nothing is drawn twice.

    Samples stand every quarter of a knot step. One is covered where another curve, or the same
    one more than two knot steps away in tau, passes within half a knot step in a direction within
    30 degrees and has a higher (mean weight there, -curve_id).
    """
    samples = sample_level(level, level.knot_step_m / SAMPLES_PER_STEP)
    if not len(samples.tau_m):
        return 1.0
    covered = covered_samples(samples, level.curve_ids.astype(np.int64), level.knot_step_m)
    # of two passes one is the heavier: some sample is always left
    return len(covered) / float(np.count_nonzero(~covered))


def covered_samples(
    samples: LevelSamples, curve_ids: NDArray[np.int64], knot_step_m: float
) -> NDArray[np.bool_]:
    """(S,) bool: the samples that another, heavier pass of a curve covers."""
    first = np.flatnonzero(np.diff(samples.piece) == 0)  # segments between neighbouring samples
    chord = samples.points[first + 1] - samples.points[first]
    length = np.hypot(chord[:, 0], chord[:, 1])
    reach_m = REACH * knot_step_m
    middles = samples.points[first] + 0.5 * chord
    sample, segment = near_pairs(samples.points, middles, reach_m + 0.5 * length.max(initial=0.0))

    other = first[segment]
    same_curve = samples.curve[sample] == samples.curve[other]
    tau_m = np.abs(samples.tau_m[sample] - samples.tau_m[other])
    keep = ~same_curve | (tau_m > APART * knot_step_m)
    sample, segment, other = sample[keep], segment[keep], other[keep]

    square = np.maximum(length[segment] ** 2, 1e-300)
    offset = samples.points[sample] - samples.points[other]
    f = np.clip(np.einsum("ij,ij->i", offset, chord[segment]) / square, 0.0, 1.0)
    off = offset - f[:, None] * chord[segment]
    along = np.einsum("ij,ij->i", samples.tangents[sample], chord[segment])
    weight = samples.weight[other] + f * (samples.weight[other + 1] - samples.weight[other])
    heavier = _outranks(
        (weight, curve_ids[samples.curve[other]]),
        (samples.weight[sample], curve_ids[samples.curve[sample]]),
    )
    within = np.hypot(off[:, 0], off[:, 1]) <= reach_m
    covers = heavier & within & (along >= COS_TURN * length[segment])
    covered = np.zeros(len(samples.tau_m), bool)
    covered[sample[covers]] = True
    return covered


def near_pairs(points: Points, others: Points, reach_m: float) -> Pairs:
    """Rows of points and of others that may be within `reach_m`: all that are, and a few more.

    Both are hashed into square cells of that side; a point meets the 3 x 3 cells round its own.
    """
    if not len(points) or not len(others):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    low = np.minimum(points.min(axis=0), others.min(axis=0)) - reach_m
    cell = np.floor((points - low) / reach_m).astype(np.int64)
    other_cell = np.floor((others - low) / reach_m).astype(np.int64)
    columns = int(max(cell[:, 0].max(), other_cell[:, 0].max())) + 2
    other_key = other_cell @ [1, columns]
    order = np.argsort(other_key, kind="stable")
    ordered = other_key[order]
    found: list[Pairs] = []
    for row in (-1, 0, 1):
        # three cells of one row have consecutive keys
        key = cell @ [1, columns] + row * columns
        begin = np.searchsorted(ordered, key - 1)
        count = np.searchsorted(ordered, key + 1, side="right") - begin
        which = np.repeat(np.arange(len(points)), count)
        number = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        found.append((which, order[begin[which] + number]))
    return np.concatenate([a for a, _ in found]), np.concatenate([b for _, b in found])


def _outranks(
    a: tuple[Vector, NDArray[np.int64]], b: tuple[Vector, NDArray[np.int64]]
) -> NDArray[np.bool_]:
    """Whether (weight, -curve_id) of a is higher than that of b."""
    return np.asarray((a[0] > b[0]) | ((a[0] == b[0]) & (a[1] < b[1])))
