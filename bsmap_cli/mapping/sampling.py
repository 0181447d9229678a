"""Where a level's curves are drawn, and points along them; all curves at once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.map_document import LevelSamples, MapLevel

SLIVER = 1e-6  # [knot steps]: shorter pieces come from rounding tau to float32


@dataclass(frozen=True, slots=True)
class DrawnPieces:
    """The parts of curves that are drawn: within [tau_start, tau_end], where no weight is 0.

    curve : (P,) index into the level, ascending; start, end : (P,) [knot steps], counted from the
    start of the curve's domain, so that span s is [s, s + 1].
    """

    curve: NDArray[np.int64]
    start: Vector
    end: Vector


def drawn_pieces(level: MapLevel) -> DrawnPieces:
    """Runs of drawn spans, the first and the last one cut at tau_start and tau_end."""
    degree = level.degree
    spans = np.maximum(level.point_counts - degree, 0)
    curve = np.repeat(np.arange(len(level)), spans)
    span = np.arange(len(curve)) - np.repeat(np.cumsum(spans) - spans, spans)
    start_u = level.tau_start_m.astype(np.float64) / level.knot_step_m - degree
    end_u = level.tau_end_m.astype(np.float64) / level.knot_step_m - degree
    start, end = np.maximum(span, start_u[curve]), np.minimum(span + 1, end_u[curve])

    zeros = np.concatenate(([0], np.cumsum(level.weights == 0)))
    row = level.offsets()[curve] + span
    drawn = (zeros[row + degree + 1] == zeros[row]) & (end > start)
    first = drawn.copy()
    first[1:] &= ~(drawn[:-1] & (curve[1:] == curve[:-1]))
    last = drawn.copy()
    last[:-1] &= ~(drawn[1:] & (curve[1:] == curve[:-1]))
    pieces = DrawnPieces(curve[first], start[first], end[last])
    long = pieces.end - pieces.start > SLIVER
    return DrawnPieces(pieces.curve[long], pieces.start[long], pieces.end[long])


def evaluate(
    level: MapLevel, curve: NDArray[np.int64], u: Vector, derivative: int = 0
) -> tuple[Points, Vector]:
    """Points of many curves at once, and the mean weight of each point's control points.

    curve : (m,) index into the level; u : (m,) [knot steps] from the start of the curve's domain,
    clamped to it. Derivatives are with respect to u.
    """
    degree = level.degree
    span = np.clip(np.floor(u), 0, level.point_counts[curve] - degree - 1).astype(np.int64)
    f = np.clip(u - span, 0.0, 1.0)
    powers = [np.ones_like(f)]
    while len(powers) <= degree - derivative:
        powers.append(powers[-1] * f)
    row = level.offsets()[curve] + span
    # x + iy, so that one gather serves both coordinates
    control = np.ascontiguousarray(level.control_points).view(np.complex64)[:, 0]
    points, weight = np.zeros(len(f), np.complex128), np.zeros(len(f))
    for a, coefficients in enumerate(basis_matrix(degree)):
        basis = np.zeros_like(f)
        for p in range(derivative, degree + 1):
            falling = math.perm(p, derivative)
            basis += falling * coefficients[p] * powers[p - derivative]
        points += basis * control[row + a].astype(np.complex128)
        weight += level.weights[row + a]
    return points.view(np.float64).reshape(-1, 2), weight / (degree + 1)


def sample_level(level: MapLevel, step_m: float) -> LevelSamples:
    """Samples of every drawn piece, both its ends among them, evenly spaced in tau.

    step_m : greatest distance in tau between neighbours [m]; map curves have about unit speed.
    """
    return sample_pieces(level, drawn_pieces(level), step_m)


def sample_counts(level: MapLevel, pieces: DrawnPieces, step_m: float) -> NDArray[np.int64]:
    """(P,) how many samples `sample_pieces` takes of each piece."""
    length = pieces.end - pieces.start
    intervals = np.maximum(np.ceil(length * (level.knot_step_m / step_m) - SLIVER), 1)
    return np.asarray(intervals.astype(np.int64) + 1)


def sample_places(
    level: MapLevel, pieces: DrawnPieces, step_m: float
) -> tuple[NDArray[np.int64], Vector]:
    """Piece and u [knot steps] of each sample that `sample_pieces` takes."""
    counts = sample_counts(level, pieces, step_m)
    intervals = (counts - 1).astype(np.float64)
    piece = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(piece)) - np.repeat(np.cumsum(counts) - counts, counts)
    fraction = number / intervals[piece]
    return piece, (1.0 - fraction) * pieces.start[piece] + fraction * pieces.end[piece]


def sample_pieces(level: MapLevel, pieces: DrawnPieces, step_m: float) -> LevelSamples:
    """The same for some pieces of the level's curves."""
    piece, u = sample_places(level, pieces, step_m)
    curve = pieces.curve[piece]
    points, weight = evaluate(level, curve, u)
    velocity, _ = evaluate(level, curve, u, derivative=1)
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    tangents = velocity / np.where(speed > 0.0, speed, 1.0)[:, None]
    first = level.first_indices.astype(np.float64)[curve] + level.degree
    return LevelSamples(points, tangents, curve, piece, (first + u) * level.knot_step_m, weight)
