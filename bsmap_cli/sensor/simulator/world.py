"""A made-up world: what stands in it, what leaves or arrives, and what moves through it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.sensor.simulator.motion import Motion

Table = NDArray[np.float64]
ARC_DEVIATION_M = 5e-5  # a drawn arc never leaves the true one by more


@dataclass(frozen=True, slots=True)
class Shapes:
    """Opaque surfaces, both sides visible, in one frame.

    segments : (s, 4) float64, x0, y0, x1, y1 [m].
    arcs : (a, 5) float64, centre x, y, radius [m], start angle, counter-clockwise sweep in
        (0, 2 pi] [rad].
    """

    segments: Table
    arcs: Table

    def __len__(self) -> int:
        return len(self.segments) + len(self.arcs)

    def __add__(self, other: Shapes) -> Shapes:
        return Shapes(
            np.concatenate((self.segments, other.segments)), np.concatenate((self.arcs, other.arcs))
        )

    def at(self, pose: SE2) -> Shapes:
        """The same surfaces, carried from the frame of `pose` into the outer one."""
        segments, arcs = self.segments.copy(), self.arcs.copy()
        segments[:, 0:2] = pose.transform(segments[:, 0:2])
        segments[:, 2:4] = pose.transform(segments[:, 2:4])
        arcs[:, 0:2] = pose.transform(arcs[:, 0:2])
        arcs[:, 3] += pose.theta
        return Shapes(segments, arcs)

    def polylines(self) -> list[Points]:
        """One (m, 2) polyline a surface, segments first; arcs are flattened to 0.05 mm."""
        lines = [row.reshape(2, 2) for row in self.segments]
        return lines + [_flatten_arc(row) for row in self.arcs]


@dataclass(frozen=True, slots=True, kw_only=True)
class Guest:
    """Something that is not always there, or that moves.

    shapes : in the guest's own frame.
    motion : the guest in the world over simulated time, or a pose where it stands still.
    from_s, to_s : it is seen in [from_s, to_s) of simulated time.
    """

    shapes: Shapes
    motion: Motion | SE2
    from_s: float = -math.inf
    to_s: float = math.inf

    @property
    def stands(self) -> bool:
        """Whether it never moves while it is there."""
        return isinstance(self.motion, SE2)

    def pose_world_guest(self, time_s: float) -> SE2:
        """Where it is at simulated time `time_s`."""
        if isinstance(self.motion, SE2):
            return self.motion
        return SE2.from_array(self.motion.poses(np.array([time_s]))[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class Surface:
    """A true surface that stands still, world frame [m], seen in [from_s, to_s)."""

    points: Points
    kind: str
    from_s: float = -math.inf
    to_s: float = math.inf


@dataclass(frozen=True, slots=True)
class World:
    """What a lidar can see, world frame [m]."""

    standing: Shapes
    guests: tuple[Guest, ...] = ()

    def visitors(self, time_s: float) -> Shapes:
        """The guests that are there at `time_s`, world frame."""
        present = [guest for guest in self.guests if guest.from_s <= time_s < guest.to_s]
        return gather(guest.shapes.at(guest.pose_world_guest(time_s)) for guest in present)

    def surfaces(self) -> list[Surface]:
        """All surfaces that do not move, with the time for which they are there."""
        found = _surfaces(self.standing, -math.inf, math.inf)
        for guest in self.guests:
            if isinstance(guest.motion, SE2):
                found += _surfaces(guest.shapes.at(guest.motion), guest.from_s, guest.to_s)
        return found


def _surfaces(shapes: Shapes, from_s: float, to_s: float) -> list[Surface]:
    kinds = ["segment"] * len(shapes.segments) + ["arc"] * len(shapes.arcs)
    return [
        Surface(points=line, kind=kind, from_s=from_s, to_s=to_s)
        for line, kind in zip(shapes.polylines(), kinds, strict=True)
    ]


def _flatten_arc(row: Vector) -> Points:
    x, y, radius, start, sweep = row
    step = 2.0 * math.acos(max(0.0, 1.0 - ARC_DEVIATION_M / radius))
    angles = start + np.linspace(0.0, sweep, max(2, math.ceil(sweep / step) + 1))
    return np.stack((x + radius * np.cos(angles), y + radius * np.sin(angles)), axis=-1)


def gather(parts: Iterable[Shapes]) -> Shapes:
    """All parts as one; none at all gives an empty one."""
    parts = list(parts)
    return Shapes(
        np.concatenate([np.zeros((0, 4))] + [part.segments for part in parts]),
        np.concatenate([np.zeros((0, 5))] + [part.arcs for part in parts]),
    )


def polyline(*corners: Sequence[float], closed: bool = False) -> Shapes:
    """Straight walls from corner to corner; equal neighbours count once."""
    points = np.array(corners, np.float64)
    ends = np.roll(points, -1, axis=0) if closed else points[1:]
    starts = points if closed else points[:-1]
    apart = (starts != ends).any(axis=1)
    return Shapes(np.hstack((starts, ends))[apart], np.zeros((0, 5)))


def box(x: float, y: float, width_m: float, depth_m: float, angle_deg: float = 0.0) -> Shapes:
    """A rectangle round its centre (x, y), turned counter-clockwise."""
    half_x, half_y = width_m / 2, depth_m / 2
    corners = ((-half_x, -half_y), (half_x, -half_y), (half_x, half_y), (-half_x, half_y))
    return polyline(*corners, closed=True).at(SE2(x, y, math.radians(angle_deg)))


def regular_polygon(x: float, y: float, radius_m: float, sides: int, angle_deg: float) -> Shapes:
    """A polygon round (x, y), one corner in direction `angle_deg`."""
    angles = math.radians(angle_deg) + np.arange(sides) * (math.tau / sides)
    corners = np.stack((x + radius_m * np.cos(angles), y + radius_m * np.sin(angles)), axis=-1)
    return polyline(*corners, closed=True)


def arc(x: float, y: float, radius_m: float, start_deg: float, sweep_deg: float) -> Shapes:
    """A part of a circle, counter-clockwise from `start_deg`, 0 < `sweep_deg` <= 360."""
    row = [x, y, radius_m, math.radians(start_deg), math.radians(sweep_deg)]
    return Shapes(np.zeros((0, 4)), np.array([row]))


def circle(x: float, y: float, radius_m: float) -> Shapes:
    """A round pillar."""
    return arc(x, y, radius_m, 0.0, 360.0)
