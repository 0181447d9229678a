"""Where the next scan should be, and how far to trust that."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bsmap_cli.geometry.compiled import inlined
from bsmap_cli.geometry.compiled_poses import Pose, as_pose, relative
from bsmap_cli.geometry.kernels import magnitude
from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.settings import setting

MEMORY = 0.05  # share of the newest surprise
CRUISE = 0.25  # share of the newest step in the velocity that is kept where walls say nothing
LONGEST_S = 0.5  # no robot gathers speed for longer
FOLLOWING = 0.6  # of a match's deviation is in the step to it: two in a row err alike
ODOMETRY_DRIFT = 0.1  # of the way and of the turn: what raw odometry slips at its worst
ODOMETRY_TURN = 0.001  # and turns on a straight way [rad per finest knot step]
LEAST_SIGMA = 1e-6  # of any prediction [m] and [rad], so that its information is finite
UNTOLD = (math.nan, math.nan, math.nan)  # where the log has no odometry


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


class Motion(NamedTuple):
    """How the base moved of late. Every scan makes a new one.

    step : (x, y [m], theta [rad]) from the scan before to the last one, in the frame of the base.
    cruise_x_m, cruise_y_m : what a step usually is; steps : how many there have been.
    spread_m, spread_rad : root mean square of how far steps differ from those before them.
    vague_m : what the match that tells of the last step leaves open.
    odometry : pose of the base in its frame at the last scan, or `UNTOLD`.
    """

    step: Pose
    cruise_x_m: float
    cruise_y_m: float
    steps: float
    spread_m: float
    spread_rad: float
    vague_m: float
    odometry: Pose


class MotionRule(NamedTuple):
    """`PredictionSettings` in metres, radians and seconds, for compiled code."""

    odometry_m: float
    odometry_rad: float
    unit_m: float
    margin: float
    floor_m: float
    floor_rad: float
    acceleration_m_s2: float
    acceleration_rad_s2: float


class Prediction(NamedTuple):
    """`step` is the motion in the body frame since the last scan.

    sigma_m, sigma_rad : how far the true step may be off. drift_m : what a step adds to the error
    of the way where nothing but this prediction is known, drift_rad : to that of the heading.
    by_odometry : wheels say so, and not the motion so far.
    """

    step: Pose
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


def motion_rule(settings: PredictionSettings, finest_step_m: float) -> MotionRule:
    """The settings for a map of this knot step."""
    return MotionRule(
        odometry_m=settings.odometry_sigma * finest_step_m,
        odometry_rad=math.radians(settings.odometry_sigma_deg),
        unit_m=finest_step_m,
        margin=float(settings.motion_margin),
        floor_m=settings.motion_floor * finest_step_m / settings.motion_margin,
        floor_rad=0.1 * math.radians(settings.motion_sigma_deg) / settings.motion_margin,
        acceleration_m_s2=float(settings.acceleration_m_s2),
        acceleration_rad_s2=math.radians(settings.acceleration_deg_s2),
    )


def unknown_motion(settings: PredictionSettings, finest_step_m: float) -> Motion:
    """Before the first scan."""
    return Motion(
        step=(0.0, 0.0, 0.0),
        cruise_x_m=0.0,
        cruise_y_m=0.0,
        steps=-1.0,  # the first pose is no step
        spread_m=settings.motion_sigma * finest_step_m / settings.motion_margin,
        spread_rad=math.radians(settings.motion_sigma_deg) / settings.motion_margin,
        vague_m=0.0,
        odometry=UNTOLD,
    )


def told(pose_odom_base: SE2 | None) -> Pose:
    """Odometry of a scan as compiled code knows it; what is no number is not told."""
    if pose_odom_base is None or not all(map(math.isfinite, pose_odom_base)):
        return UNTOLD
    return as_pose(pose_odom_base)


@inlined
def predict(motion: Motion, odometry: Pose, elapsed_s: float, rule: MotionRule) -> Prediction:
    """The step from the last scan to this one: odometry where the log has it, else the last step.

    odometry : `told` by this scan; elapsed_s : since the last one.
    """
    if not (math.isnan(odometry[0]) or math.isnan(motion.odometry[0])):
        step = relative(odometry, motion.odometry)
        way = magnitude(step[0], step[1])
        turn = abs(step[2])
        return Prediction(
            step,
            max(rule.odometry_m + way, LEAST_SIGMA),
            max(rule.odometry_rad + turn, LEAST_SIGMA),
            ODOMETRY_DRIFT * way,
            ODOMETRY_DRIFT * turn + ODOMETRY_TURN * way / rule.unit_m,
            True,
        )
    within_s = min(elapsed_s, LONGEST_S)
    started_m = rule.acceleration_m_s2 * within_s * within_s
    started_rad = rule.acceleration_rad_s2 * within_s * within_s
    vague_m = max(magnitude(started_m, motion.vague_m), LEAST_SIGMA)
    sigma_m = max(rule.margin * motion.spread_m, vague_m)
    sigma_rad = max(rule.margin * motion.spread_rad, started_rad, LEAST_SIGMA)
    return Prediction(motion.step, sigma_m, sigma_rad, sigma_m, sigma_rad, False)


@inlined
def moved_on(
    motion: Motion, step: Pose, odometry: Pose, measured: bool, vague_m: float, rule: MotionRule
) -> Motion:
    """The motion once it is known what the step turned out to be.

    measured : the walls said so in all directions. vague_m : `worst_sigma_m` of the match that
    says so. A velocity taken from such poses is hardly better than they in the direction that the
    walls tell least of, and a robot that brakes must not be carried past the little that holds it.
    """
    steps = motion.steps + 1.0
    share = max(CRUISE, 1.0 / max(steps, 1.0))  # a log may begin on the way
    cruise_x = motion.cruise_x_m + share * (step[0] - motion.cruise_x_m)
    cruise_y = motion.cruise_y_m + share * (step[1] - motion.cruise_y_m)
    if not measured:  # what no wall says must not grow out of the noise of one step
        cruised = (cruise_x, cruise_y, step[2])
        spread_m, spread_rad = motion.spread_m, motion.spread_rad
        return Motion(cruised, cruise_x, cruise_y, steps, spread_m, spread_rad, 0.0, odometry)
    x, y, turn = relative(step, motion.step)
    spread_m = max(rule.floor_m, _faded(motion.spread_m, 0.5 * (x * x + y * y)))
    spread_rad = max(rule.floor_rad, _faded(motion.spread_rad, turn * turn))
    vague = FOLLOWING * vague_m
    return Motion(step, cruise_x, cruise_y, steps, spread_m, spread_rad, vague, odometry)


@inlined
def worst_sigma_m(information: Points) -> float:
    """Deviation [m] of a position in the direction that (3, 3) information tells least of."""
    xx, xy, yy = information[0, 0], information[0, 1], information[1, 1]
    least = 0.5 * (xx + yy) - magnitude(0.5 * (xx - yy), xy)
    return 1.0 / math.sqrt(max(least, 1e-12))


@inlined
def _faded(spread: float, squared: float) -> float:
    """Root mean square with a memory of about twenty scans."""
    return math.sqrt((1.0 - MEMORY) * spread * spread + MEMORY * squared)


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
