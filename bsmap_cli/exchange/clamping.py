"""Pieces of uniform curves as clamped ones, by exact knot insertion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.exchange.selection import SelectedLevel
from bsmap_cli.geometry.se2 import Points, Vector


@dataclass(frozen=True, slots=True)
class ClampedCurve:
    """A B-spline whose first and last d + 1 knots [m] are equal: it begins and ends in its ends.

    curve : index into the level; knots : (c + d + 1,), from 0; control_points : (c, 2) [m].
    """

    curve: int
    knots: Vector
    control_points: Points


def clamped_pieces(selected: SelectedLevel) -> list[ClampedCurve]:
    """The drawn pieces, unchanged as curves, clamped where they begin and end."""
    level, pieces = selected.level, selected.pieces
    degree = level.degree
    knots = [
        clamped_knots(start, end, degree)
        for start, end in zip(pieces.start.tolist(), pieces.end.tolist(), strict=True)
    ]
    if not knots:
        return []
    counts = np.array([len(each) - degree - 1 for each in knots])
    # control point i is the polar form of the span at knot j at the arguments t_(i+1) .. t_(i+d)
    windows = [np.lib.stride_tricks.sliding_window_view(t[1:-1], degree) for t in knots]
    arguments = np.concatenate(windows)
    begins = [t[np.clip(np.arange(len(t) - degree - 1), degree, None)] for t in knots]
    span = np.floor(np.concatenate(begins) + 1e-9).astype(np.int64)
    row = level.offsets()[np.repeat(pieces.curve, counts)] + span
    points = polar_form(level.control_points.astype(np.float64), row, span, arguments)
    split = np.split(points, np.cumsum(counts)[:-1])
    return [
        ClampedCurve(int(curve), (t - t[0]) * level.knot_step_m, own)
        for curve, t, own in zip(pieces.curve, knots, split, strict=True)
    ]


def clamped_knots(start: float, end: float, degree: int) -> Vector:
    """Knots of [start, end]: the ends d + 1 times and the whole numbers between them once."""
    inner = np.arange(np.floor(start + 1e-9) + 1.0, np.ceil(end - 1e-9))
    ends = np.ones(degree + 1)
    return np.concatenate((start * ends, inner, end * ends))


def polar_form(
    control_points: Points, row: NDArray[np.int64], span: NDArray[np.int64], arguments: Points
) -> Points:
    """(m, 2) blossom of each span at its d arguments: de Boor's scheme, an argument a stage.

    row : (m,) first active control point of the span; span : (m,) its first knot; arguments :
    (m, d). With all arguments equal to u this is the curve at u.
    """
    degree = arguments.shape[1]
    stage = control_points[row[:, None] + np.arange(degree + 1)]
    for r in range(1, degree + 1):
        first_knot = span[:, None] - degree + np.arange(r, degree + 1)
        share = ((arguments[:, r - 1, None] - first_knot) / (degree + 1 - r))[..., None]
        stage = (1.0 - share) * stage[:, :-1] + share * stage[:, 1:]
    return np.asarray(stage[:, 0])
