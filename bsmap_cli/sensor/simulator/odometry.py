"""Wheel odometry that is wrong the way real odometry is: scale, noise and slip."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Vector
from bsmap_cli.sensor.simulator.motion import Motion

TICK_S = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class OdometryModel:
    """Errors of the increments between two ticks of the encoders; all drawn from one seed.

    scale_sigma, turn_scale_sigma : of the constant scale error of distance and of angle [-].
    distance_sigma, turn_sigma : random walk, in m per sqrt(m) and rad per sqrt(rad).
    heading_sigma : random walk of the heading, rad per sqrt(m).
    metres_per_slip : mean distance between two slips; a slip lasts `slip_s`, in which the wheels
        turn by up to `slip_share` too far and by up to `slip_turn_rad_s` to one side.
    """

    scale_sigma: float = 0.01
    turn_scale_sigma: float = 0.02
    distance_sigma: float = 0.01
    turn_sigma: float = 0.01
    heading_sigma: float = 0.005
    metres_per_slip: float = 20.0
    slip_s: float = 0.4
    slip_share: float = 0.5
    slip_turn_rad_s: float = 0.2


def odometry_poses(
    motion: Motion, times_s: Vector, model: OdometryModel, random: np.random.Generator
) -> NDArray[np.float64]:
    """(m, 3) x, y [m], heading [rad] at each time, in a frame that is the base's pose at time 0."""
    ticks_s = np.arange(0.0, motion.duration_s + 2.0 * TICK_S, TICK_S)
    ahead, aside, turned = _increments(motion.poses(ticks_s))
    distance, angle = np.hypot(ahead, aside), np.abs(turned)
    noise = random.standard_normal((3, len(ahead)))
    slip_ahead, slip_turn = _slips(distance, model, random)
    scale, turn_scale = 1.0 + random.standard_normal(2) * (
        model.scale_sigma,
        model.turn_scale_sigma,
    )
    ahead = ahead * (scale + slip_ahead) + noise[0] * model.distance_sigma * np.sqrt(distance)
    turned = turned * turn_scale + slip_turn
    turned += noise[1] * model.turn_sigma * np.sqrt(angle)
    turned += noise[2] * model.heading_sigma * np.sqrt(distance)
    poses = _integrate(ahead, aside, turned)
    columns = [np.interp(times_s, ticks_s, poses[:, axis]) for axis in range(3)]
    return np.stack(columns, axis=-1)


def _increments(poses: NDArray[np.float64]) -> tuple[Vector, Vector, Vector]:
    """Motion from tick to tick along, across and about the heading half way."""
    steps = np.diff(poses, axis=0)
    heading = poses[:-1, 2] + steps[:, 2] / 2.0
    cos, sin = np.cos(heading), np.sin(heading)
    return cos * steps[:, 0] + sin * steps[:, 1], cos * steps[:, 1] - sin * steps[:, 0], steps[:, 2]


def _integrate(ahead: Vector, aside: Vector, turned: Vector) -> NDArray[np.float64]:
    """The inverse of `_increments`, from the identity."""
    heading = np.concatenate(([0.0], np.cumsum(turned)))
    middle = heading[:-1] + turned / 2.0
    cos, sin = np.cos(middle), np.sin(middle)
    x = np.concatenate(([0.0], np.cumsum(cos * ahead - sin * aside)))
    y = np.concatenate(([0.0], np.cumsum(sin * ahead + cos * aside)))
    return np.stack((x, y, heading), axis=-1)


def _slips(
    distance: Vector, model: OdometryModel, random: np.random.Generator
) -> tuple[Vector, Vector]:
    """Extra share of distance and extra turn [rad] of every tick; nothing slips at rest."""
    begins = random.random(len(distance)) < distance / model.metres_per_slip
    shares = np.zeros(len(distance))
    turns = np.zeros(len(distance))
    length = max(1, round(model.slip_s / TICK_S))
    for tick in np.flatnonzero(begins):
        slipping = slice(tick, tick + length)
        shares[slipping] = random.uniform(0.0, model.slip_share)
        turns[slipping] = random.uniform(-1.0, 1.0) * model.slip_turn_rad_s * TICK_S
    return shares, np.where(distance > 0.0, turns, 0.0)
