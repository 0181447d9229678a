"""The same curves on another lattice, by least squares: coarser levels of a map that has one."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.control_points import fit_control_points
from bsmap_cli.mapping.fitting import lattice_domain
from bsmap_cli.mapping.freeze import join_levels
from bsmap_cli.mapping.map_document import MapDocument, MapLevel
from bsmap_cli.mapping.merging import observed_share
from bsmap_cli.mapping.sampling import sample_level

SAMPLES_PER_STEP = 8  # of the finer of both lattices
PENALTY = 1e-3  # on third differences; a curve that is there already needs no more
SHORTEST = 0.75  # shorter pieces carry no curve [knot steps of the new lattice]


class _Fitted(NamedTuple):
    """One drawn piece on the new lattice: `low` is its first span, u in its knot steps."""

    curve: int
    low: int
    start_u: float
    end_u: float
    points: Points
    weights: Vector


def resampled_level(level: MapLevel, knot_step_m: float, degree: int | None = None) -> MapLevel:
    """Every drawn piece as a curve of knot step `knot_step_m`, with the same tau and frame.

    degree : of the new curves; None: as before.
    """
    degree = level.degree if degree is None else degree
    parts = [_resampled(part, knot_step_m, degree) for _, part in level.portions()]
    return join_levels(parts) if parts else _resampled(level, knot_step_m, degree)


def _resampled(level: MapLevel, knot_step_m: float, degree: int) -> MapLevel:
    matrix = basis_matrix(degree)
    samples = sample_level(level, min(level.knot_step_m, knot_step_m) / SAMPLES_PER_STEP)
    u = samples.tau_m / knot_step_m
    bounds = np.flatnonzero(np.diff(samples.piece, prepend=-1, append=-2))
    fitted = []
    for begin, end in zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
        rows = slice(begin, end)
        if u[end - 1] - u[begin] < SHORTEST:
            continue
        piece = _fit(
            int(samples.curve[begin]), u[rows], samples.points[rows], samples.weight[rows], matrix
        )
        if piece is not None:
            fitted.append(piece)
    return _as_level(level, knot_step_m, degree, fitted)


def one_level(document: MapDocument) -> MapLevel:
    """What makes up the whole map, on the lattice of its finest level."""
    chosen = document.chosen_levels()
    finest = min(level.knot_step_m for level in chosen)
    same = [
        level if level.knot_step_m == finest else resampled_level(level, finest) for level in chosen
    ]
    return same[0] if len(same) == 1 else join_levels(same)


def _fit(
    curve: int, u: Vector, points: Points, sample_weights: Vector, matrix: Points
) -> _Fitted | None:
    low, high = lattice_domain(u[0], u[-1])
    count = high - low + matrix.shape[0] - 1
    share = np.gradient(u)
    share[0] *= 0.5
    share[-1] *= 0.5
    found, none = np.empty((count, 2)), np.zeros((count, 2))
    if not fit_control_points(u, points, share, matrix, low, PENALTY, none, np.zeros(count), found):
        return None
    covered, weighted = np.empty(count), np.empty(count)
    observed_share(u, share, matrix, low, covered)
    observed_share(u, share * sample_weights, matrix, low, weighted)
    weights = weighted / np.maximum(covered, 1e-9)
    return _Fitted(curve, low, float(u[0]), float(u[-1]), found, weights)


def _as_level(level: MapLevel, knot_step_m: float, degree: int, fitted: list[_Fitted]) -> MapLevel:
    curve = np.array([piece.curve for piece in fitted], np.int64)
    first = np.array([piece.low for piece in fitted], np.int64) - degree
    start = np.array([piece.start_u for piece in fitted], np.float64)
    end = np.array([piece.end_u for piece in fitted], np.float64)
    weights = np.concatenate([np.zeros(0), *(piece.weights for piece in fitted)])
    return MapLevel(
        degree=degree,
        knot_step_m=knot_step_m,
        curve_ids=np.arange(len(fitted), dtype=np.uint32),
        tau_start_m=((start - first) * knot_step_m).astype(np.float32),
        tau_end_m=((end - first) * knot_step_m).astype(np.float32),
        flags=level.flags[curve],
        observations=level.observations[curve],
        first_indices=first.astype(np.int32),
        point_counts=np.array([len(piece.points) for piece in fitted], np.int64),
        control_points=np.concatenate(
            [np.zeros((0, 2)), *(piece.points for piece in fitted)]
        ).astype(np.float32),
        weights=np.clip(np.round(weights), 1, 255).astype(np.uint8),
    )
