"""Where the next scan should be, and how far to trust that."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.settings import setting


ODOMETRY_DRIFT = 0.1  # of the way: what raw odometry slips at its worst


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
        0.15, "of constant velocity, without odometry [finest knot steps]", minimum=0.0
    )
    motion_sigma_deg: float = setting(1.5, "of constant turn rate, without odometry", minimum=0.0)


@dataclass(frozen=True, slots=True)
class Prediction:
    """`step` is the motion in the body frame since the last scan.

    sigma_m, sigma_rad : how far the true step may be off. drift_m : what a step adds to the error
    of the way where nothing but this prediction is known.
    """

    step: SE2
    sigma_m: float
    sigma_rad: float
    drift_m: float

    def information(self) -> Points:
        """(3, 3) inverse covariance; the same in every frame, as translation has no direction."""
        return np.diag([self.sigma_m**-2.0, self.sigma_m**-2.0, self.sigma_rad**-2.0])


class Predictor:
    """Odometry increments where the log has them, else constant velocity."""

    def __init__(self, settings: PredictionSettings, finest_step_m: float) -> None:
        self.settings = settings
        self.unit_m = finest_step_m
        self._odometry: SE2 | None = None
        self.last_step = SE2.identity()

    def predict(self, pose_odom_base: SE2 | None) -> Prediction:
        """The step from the last scan to this one; `observe` must follow."""
        settings = self.settings
        if pose_odom_base is not None and self._odometry is not None:
            step = self._odometry.inverse() @ pose_odom_base
            way = math.hypot(step.x, step.y)
            return Prediction(
                step,
                settings.odometry_sigma * self.unit_m + way,
                math.radians(settings.odometry_sigma_deg) + abs(step.theta),
                ODOMETRY_DRIFT * way,
            )
        sigma_m = settings.motion_sigma * self.unit_m
        return Prediction(
            self.last_step, sigma_m, math.radians(settings.motion_sigma_deg), sigma_m
        )

    def observe(self, step: SE2, pose_odom_base: SE2 | None) -> None:
        """Tell what the step turned out to be."""
        self.last_step = step
        self._odometry = pose_odom_base
