"""Where the next scan should be, and how far to trust that."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.settings import setting

MEMORY = 0.05  # share of the newest surprise
CRUISE = 0.25  # share of the newest step in the velocity that is kept where walls say nothing
LONGEST_S = 0.5  # no robot gathers speed for longer
FOLLOWING = 0.6  # of a match's deviation is in the step to it: two in a row err alike
ODOMETRY_DRIFT = 0.1  # of the way and of the turn: what raw odometry slips at its worst
ODOMETRY_TURN = 0.001  # and turns on a straight way [rad per finest knot step]


@dataclass(frozen=True, slots=True, kw_only=True)
class PredictionSettings:
    """Deviation of the prediction from the truth, for one scan."""

    odometry_sigma: float = setting(
        0.5, "of an odometry step, to which its length is added [finest knot steps]", minimum=0.0
    )
    odometry_sigma_deg: float = setting(
        3.0, "of an odometry turn, to which the turn is added", minimum=0.0
    )
    motion_sigma: float = setting(
        0.3,
        "of constant velocity at first, then what it is seen to be [finest knot steps]",
        minimum=0.0,
    )
    motion_sigma_deg: float = setting(2.0, "of constant turn rate, at first", minimum=0.0)
    motion_floor: float = setting(
        0.05,
        "neither sinks below this [finest knot steps], or a tenth of the first angle",
        minimum=0.0,
    )
    motion_margin: float = setting(
        3.0, "times the deviation seen of late: motion changes suddenly", minimum=1.0
    )
    acceleration_m_s2: float = setting(
        1.0, "without odometry: the robot may start or stop as hard at any scan", minimum=0.0
    )
    acceleration_deg_s2: float = setting(
        120.0, "without odometry: and begin or end a turn as hard", minimum=0.0
    )


class Prediction(NamedTuple):
    """`step` is the motion in the body frame since the last scan.

    sigma_m, sigma_rad : how far the true step may be off. drift_m : what a step adds to the error
    of the way where nothing but this prediction is known, drift_rad : to that of the heading.
    by_odometry : wheels say so, and not the motion so far.
    """

    step: SE2
    sigma_m: float
    sigma_rad: float
    drift_m: float
    drift_rad: float
    by_odometry: bool

    def information(self) -> Points:
        """(3, 3) inverse covariance; the same in every frame, as translation has no direction."""
        information = np.zeros((3, 3))
        information[0, 0] = information[1, 1] = self.sigma_m**-2.0
        information[2, 2] = self.sigma_rad**-2.0
        return information


class Predictor:
    """Odometry increments where the log has them, else constant velocity."""

    def __init__(self, settings: PredictionSettings, finest_step_m: float) -> None:
        self.settings = settings
        self.unit_m = finest_step_m
        self._odometry: SE2 | None = None
        self.last_step = SE2.identity()
        self._cruise_m = (0.0, 0.0)
        self._told: Points | None = None
        self._steps = -1  # the first pose is no step
        self._spread_m = settings.motion_sigma * finest_step_m / settings.motion_margin
        self._spread_rad = math.radians(settings.motion_sigma_deg) / settings.motion_margin

    def predict(self, pose_odom_base: SE2 | None, elapsed_s: float) -> Prediction:
        """The step from the last scan to this one; `observe` must follow."""
        settings = self.settings
        if pose_odom_base is not None and self._odometry is not None:
            step = pose_odom_base.relative_to(self._odometry)
            way = math.hypot(step.x, step.y)
            return Prediction(
                step,
                settings.odometry_sigma * self.unit_m + way,
                math.radians(settings.odometry_sigma_deg) + abs(step.theta),
                ODOMETRY_DRIFT * way,
                ODOMETRY_DRIFT * abs(step.theta) + ODOMETRY_TURN * way / self.unit_m,
                True,
            )
        square_s2 = min(elapsed_s, LONGEST_S) ** 2
        started_rad = math.radians(settings.acceleration_deg_s2) * square_s2
        started_m = settings.acceleration_m_s2 * square_s2
        vague_m = 0.0 if self._told is None else FOLLOWING * worst_sigma_m(self._told)
        sigma_m = max(settings.motion_margin * self._spread_m, math.hypot(started_m, vague_m))
        sigma_rad = max(settings.motion_margin * self._spread_rad, started_rad)
        return Prediction(self.last_step, sigma_m, sigma_rad, sigma_m, sigma_rad, False)

    def observe(
        self,
        step: SE2,
        pose_odom_base: SE2 | None,
        *,
        measured: bool,
        information: Points | None = None,
    ) -> None:
        """Tell what the step turned out to be, and whether the walls said so in all directions.

        information : (3, 3) of the match that says so. A velocity taken from such poses is hardly
        better than they in the direction that the walls tell least of, and a robot that brakes
        must not be carried past the little that holds it.
        """
        self._told = information if measured else None
        if measured:
            surprise = step.relative_to(self.last_step)
            settings = self.settings
            floor_m = settings.motion_floor * self.unit_m / settings.motion_margin
            floor_rad = 0.1 * math.radians(settings.motion_sigma_deg) / settings.motion_margin
            squared = 0.5 * (surprise.x**2 + surprise.y**2)
            self._spread_m = max(floor_m, _faded(self._spread_m, squared))
            self._spread_rad = max(floor_rad, _faded(self._spread_rad, surprise.theta**2))
            self.last_step = step
        self._steps += 1
        share = max(CRUISE, 1.0 / max(self._steps, 1))  # a log may begin on the way
        x, y = self._cruise_m
        self._cruise_m = (x + share * (step.x - x), y + share * (step.y - y))
        if not measured:  # what no wall says must not grow out of the noise of one step
            self.last_step = SE2(*self._cruise_m, step.theta)
        self._odometry = pose_odom_base


def worst_sigma_m(information: Points) -> float:
    """Deviation [m] of a position in the direction that (3, 3) information tells least of."""
    (xx, xy, _), (_, yy, _), _ = information.tolist()
    least = 0.5 * (xx + yy) - math.hypot(0.5 * (xx - yy), xy)
    return 1.0 / math.sqrt(max(least, 1e-12))


def _faded(spread: float, squared: float) -> float:
    """Root mean square with a memory of about twenty scans."""
    return math.sqrt((1.0 - MEMORY) * spread**2 + MEMORY * squared)


class Cadence:
    """How long the scans usually lie apart, to know a gap in the log when one comes."""

    def __init__(self) -> None:
        self.elapsed_s = 0.0
        self._usual_ns = 0.0
        self._last_ns: int | None = None

    def observe(self, stamp_ns: int) -> float:
        """Time since the last scan, in usual times; 1 where stamps repeat or step back.

        The usual time is a mean that forgets; one gap hardly moves it. `elapsed_s` tells the same
        in seconds.
        """
        elapsed = 0.0 if self._last_ns is None else float(stamp_ns - self._last_ns)
        self._last_ns = stamp_ns
        self.elapsed_s = 1e-9 * (elapsed if elapsed > 0.0 else self._usual_ns)
        if elapsed <= 0.0:
            return 1.0
        if self._usual_ns == 0.0:
            self._usual_ns = elapsed
        stretch = elapsed / self._usual_ns
        self._usual_ns += MEMORY * (min(elapsed, 3.0 * self._usual_ns) - self._usual_ns)
        return stretch
