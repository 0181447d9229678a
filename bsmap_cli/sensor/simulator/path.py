"""A drivable curve through waypoints: straight lines joined by bends of continuous curvature.

A bend is clothoid, arc, clothoid: curvature rises linearly, stays, and falls, so that a robot that
drives it at constant speed never jumps in turn rate.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector, wrap_angle

_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(12)
_STRAIGHT_RAD = 1e-9


@dataclass(frozen=True, slots=True)
class Piece:
    """A stretch of `length_m` whose curvature goes linearly from `start` to `end` [1/m]."""

    length_m: float
    start: float
    end: float


@dataclass(frozen=True, slots=True)
class Path:
    """Pieces end to end.

    starts_m : (k,) arc length at which each piece begins.
    frames : (k, 3) x, y [m], heading [rad] at its start; headings are not wrapped.
    bends : (k, 2) curvature at its start [1/m] and its slope along the path [1/m^2].
    """

    length_m: float
    starts_m: Vector
    frames: NDArray[np.float64]
    bends: NDArray[np.float64]

    def poses(self, arc_lengths_m: Vector) -> NDArray[np.float64]:
        """(m, 3) x, y [m], heading [rad] at each arc length, clipped to the path."""
        along = np.clip(arc_lengths_m, 0.0, self.length_m)
        piece = np.clip(np.searchsorted(self.starts_m, along, side="right") - 1, 0, None)
        return _advance(self.frames[piece], self.bends[piece], along - self.starts_m[piece])


def _advance(
    frames: NDArray[np.float64], bends: NDArray[np.float64], lengths_m: Vector
) -> NDArray[np.float64]:
    """Poses `lengths_m` further on a clothoid: Gauss-Legendre on cosine and sine."""
    nodes = lengths_m[:, None] * (_NODES + 1.0) / 2.0
    headings = frames[:, 2:] + bends[:, :1] * nodes + bends[:, 1:] * nodes**2 / 2.0
    half = lengths_m / 2.0
    x = frames[:, 0] + half * (np.cos(headings) @ _NODE_WEIGHTS)
    y = frames[:, 1] + half * (np.sin(headings) @ _NODE_WEIGHTS)
    heading = frames[:, 2] + bends[:, 0] * lengths_m + bends[:, 1] * lengths_m**2 / 2.0
    return np.stack((x, y, heading), axis=-1)


def join(pieces: Sequence[Piece], start: Vector) -> Path:
    """Lay the pieces end to end from the pose `start` (3,)."""
    frames, bends, starts_m = [np.asarray(start, np.float64)], [], [0.0]
    for piece in pieces:
        bends.append(np.array([piece.start, (piece.end - piece.start) / piece.length_m]))
        step = _advance(frames[-1][None], bends[-1][None], np.array([piece.length_m]))
        frames.append(step[0])
        starts_m.append(starts_m[-1] + piece.length_m)
    return Path(starts_m[-1], np.array(starts_m[:-1]), np.array(frames[:-1]), np.array(bends))


def bend_pieces(turn_rad: float, curvature: float, sharpness: float) -> list[Piece]:
    """A symmetric bend: at most `curvature` [1/m], which changes by `sharpness` [1/m^2]."""
    sign, angle = math.copysign(1.0, turn_rad), abs(turn_rad)
    peak = min(curvature, math.sqrt(angle * sharpness))
    ramp_m = peak / sharpness
    plateau_m = angle / peak - ramp_m
    pieces = [Piece(ramp_m, 0.0, sign * peak), Piece(ramp_m, sign * peak, 0.0)]
    if plateau_m > 1e-9:
        pieces.insert(1, Piece(plateau_m, sign * peak, sign * peak))
    return pieces


def _tangent_length(pieces: Sequence[Piece], turn_rad: float) -> float:
    """How far before its corner a bend begins [m]."""
    bend = join(pieces, np.zeros(3))
    return float(math.dist((0.0, 0.0), bend.poses(np.array([bend.length_m]))[0, :2])) / (
        2.0 * math.cos(turn_rad / 2.0)
    )


def through(
    waypoints: Points, curvature: float, sharpness: float, heading_rad: float = 0.0
) -> Path:
    """The path through (m, 2) waypoints [m], every inner corner cut by a bend.

    Headings count whole turns on from `heading_rad`.
    Raises ValueError where two bends would overlap.
    """
    steps = np.diff(waypoints, axis=0)
    lengths = np.hypot(steps[:, 0], steps[:, 1])
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    pieces: list[Piece] = []
    used_m = 0.0
    for index, length_m in enumerate(lengths):
        bend, cut_m = [], 0.0
        if index + 1 < len(lengths):
            turn = wrap_angle(float(headings[index + 1] - headings[index]))
            if abs(turn) > _STRAIGHT_RAD:
                bend = bend_pieces(turn, curvature, sharpness)
                cut_m = _tangent_length(bend, turn)
        straight_m = float(length_m) - used_m - cut_m
        if straight_m < 0.0:
            message = (
                f"waypoints {index} and {index + 1} leave no room for the bends: {straight_m:.2f} m"
            )
            raise ValueError(message)
        if straight_m > 1e-12:
            pieces.append(Piece(straight_m, 0.0, 0.0))
        pieces += bend
        used_m = cut_m
    start_rad = headings[0] + math.tau * round((heading_rad - headings[0]) / math.tau)
    return join(pieces, np.array([*waypoints[0], start_rad]))
