"""How a body moves: drives, turns on the spot and waits, within limits of acceleration."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import SE2, Vector, wrap_angle
from bsmap_cli.sensor.simulator.path import Path, through


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionLimits:
    """What a body can do; every motion made by `Route` stays within."""

    speed_m_s: float = 0.6
    acceleration_m_s2: float = 0.5
    turn_rate_rad_s: float = 0.8
    turn_acceleration_rad_s2: float = 1.2
    bend_radius_m: float = 0.8


def _ramp_time(distance: float, rate: float, acceleration: float) -> tuple[float, float, float]:
    """Trapezoid profile: duration, duration of one ramp, top rate."""
    top = min(rate, math.sqrt(distance * acceleration))
    ramp = top / acceleration
    return distance / top + ramp, ramp, top


def _trapezoid(times_s: Vector, distance: float, rate: float, acceleration: float) -> Vector:
    """Distance covered after `times_s` by speeding up, cruising and slowing down."""
    duration, ramp, top = _ramp_time(distance, rate, acceleration)
    times = np.clip(times_s, 0.0, duration)
    speeding = acceleration * np.minimum(times, ramp) ** 2 / 2.0
    cruising = top * np.clip(times - ramp, 0.0, duration - 2.0 * ramp)
    slowing = np.clip(times - (duration - ramp), 0.0, ramp)
    return speeding + cruising + top * slowing - acceleration * slowing**2 / 2.0


class Leg(Protocol):
    """One stretch of a motion, from rest to rest."""

    @property
    def duration_s(self) -> float:
        """How long it takes."""
        ...

    def poses(self, times_s: Vector) -> NDArray[np.float64]:
        """(m, 3) x, y [m], heading [rad] after `times_s` since the leg began."""
        ...


@dataclass(frozen=True, slots=True)
class Drive:
    """Along a path."""

    path: Path
    speed_m_s: float
    acceleration_m_s2: float

    @property
    def duration_s(self) -> float:
        """How long it takes."""
        return _ramp_time(self.path.length_m, self.speed_m_s, self.acceleration_m_s2)[0]

    def poses(self, times_s: Vector) -> NDArray[np.float64]:
        """(m, 3) poses on the path."""
        return self.path.poses(
            _trapezoid(times_s, self.path.length_m, self.speed_m_s, self.acceleration_m_s2)
        )


@dataclass(frozen=True, slots=True)
class Turn:
    """On the spot; a wait where `angle_rad` is 0."""

    start: tuple[float, float, float]
    angle_rad: float
    rate_rad_s: float
    acceleration_rad_s2: float
    wait_s: float = 0.0

    @property
    def duration_s(self) -> float:
        """How long it takes."""
        if self.angle_rad == 0.0:
            return self.wait_s
        return _ramp_time(abs(self.angle_rad), self.rate_rad_s, self.acceleration_rad_s2)[0]

    def poses(self, times_s: Vector) -> NDArray[np.float64]:
        """(m, 3) poses, all in one place."""
        poses = np.tile(np.array(self.start), (len(times_s), 1))
        if self.angle_rad != 0.0:
            turned = _trapezoid(
                times_s, abs(self.angle_rad), self.rate_rad_s, self.acceleration_rad_s2
            )
            poses[:, 2] += math.copysign(1.0, self.angle_rad) * turned
        return poses


@dataclass(frozen=True, slots=True)
class Motion:
    """Legs one after the other; at rest before and after.

    ends_s : when each leg ends, counted from the first one's begin.
    """

    legs: tuple[Leg, ...]
    ends_s: Vector

    @property
    def duration_s(self) -> float:
        """From the first leg's begin to the last one's end."""
        return float(self.ends_s[-1])

    def poses(self, times_s: Vector) -> NDArray[np.float64]:
        """(m, 3) x, y [m], heading [rad], not wrapped, at simulated times."""
        leg_of = np.minimum(np.searchsorted(self.ends_s, times_s, side="right"), len(self.legs) - 1)
        poses = np.empty((len(times_s), 3))
        for index in np.unique(leg_of):
            chosen = leg_of == index
            begin_s = self.ends_s[index] - self.legs[index].duration_s
            poses[chosen] = self.legs[index].poses(times_s[chosen] - begin_s)
        return poses


class Route:
    """Builds a motion leg by leg; a drive that starts in another direction turns there first."""

    def __init__(self, start: SE2, limits: MotionLimits | None = None) -> None:
        self._limits = limits or MotionLimits()
        self._pose = (start.x, start.y, start.theta)
        self._legs: list[Leg] = []

    def drive(
        self,
        *waypoints: Sequence[float],
        speed_m_s: float | None = None,
        bend_radius_m: float | None = None,
    ) -> Route:
        """Through the waypoints [m], without a stop on the way."""
        limits = self._limits
        curvature = 1.0 / (bend_radius_m or limits.bend_radius_m)
        speed = min(speed_m_s or limits.speed_m_s, limits.turn_rate_rad_s / curvature)
        points = np.array([self._pose[:2], *waypoints], np.float64)
        heading = math.atan2(points[1, 1] - points[0, 1], points[1, 0] - points[0, 0])
        off_rad = wrap_angle(heading - self._pose[2])
        if abs(off_rad) > 1e-9:
            self.turn(math.degrees(off_rad))
        sharpness = limits.turn_acceleration_rad_s2 / speed**2
        path = through(points, curvature, sharpness, self._pose[2])
        return self._append(Drive(path, speed, limits.acceleration_m_s2))

    def turn(self, angle_deg: float, rate_rad_s: float | None = None) -> Route:
        """On the spot, counter-clockwise positive; more than one round is allowed."""
        limits = self._limits
        rate = rate_rad_s or limits.turn_rate_rad_s
        angle = math.radians(angle_deg)
        return self._append(Turn(self._pose, angle, rate, limits.turn_acceleration_rad_s2))

    def wait(self, seconds: float) -> Route:
        """Stand still."""
        return self._append(Turn(self._pose, 0.0, 1.0, 1.0, seconds))

    def motion(self) -> Motion:
        """Everything so far."""
        return Motion(tuple(self._legs), np.cumsum([leg.duration_s for leg in self._legs]))

    def _append(self, leg: Leg) -> Route:
        self._legs.append(leg)
        x, y, heading = leg.poses(np.array([leg.duration_s]))[0]
        self._pose = (float(x), float(y), float(heading))
        return self
