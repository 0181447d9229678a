"""How far a relative pose may be off: what edges weigh, and how far a search must look."""

from __future__ import annotations

import numpy as np

from bsmap_cli.geometry.se2 import Points

DRIFT_SHARE = 0.01  # of the way travelled: what registration against a fresh map loses
DRIFT_RAD_PER_STEP = 0.0001  # turn lost per finest knot step of way
WEAK_STEPS, WEAK_RAD = 10.0, 0.35  # a lost stretch: finest knot steps, radians
FLOOR_STEPS, FLOOR_RAD = 0.4, 0.006  # what no registration goes below: the bends of a submap


def match_information(hessian: Points, knot_step_m: float) -> Points:
    """(..., 3, 3) inverse covariance of registered poses, with a floor under the deviations.

    hessian : (..., 3, 3) of the data; the data alone are far too sure of themselves, as the errors
    of map and scan do not average out.
    """
    tiny = _diagonal(1e-4 / knot_step_m**2, 1e-2)
    floor = _diagonal((FLOOR_STEPS * knot_step_m) ** 2, FLOOR_RAD**2)
    covariance = np.linalg.inv(hessian + tiny)
    return np.asarray(np.linalg.inv(covariance + floor), np.float64)


def way_deviation(
    way_m: float,
    knot_step_m: float,
    *,
    coasted_m: float = 0.0,
    coasted_rad: float = 0.0,
    weak: bool = False,
) -> tuple[float, float]:
    """Deviation [m], [rad] that tracking gathers along a way.

    coasted_m, coasted_rad : what is to be added where no wall told. weak : the map was lost.
    """
    metres = FLOOR_STEPS * knot_step_m + DRIFT_SHARE * way_m + coasted_m
    radians = FLOOR_RAD + DRIFT_RAD_PER_STEP * way_m / knot_step_m + coasted_rad
    if weak:
        metres, radians = metres + WEAK_STEPS * knot_step_m, radians + WEAK_RAD
    return metres, radians


def isotropic_information(deviation: tuple[float, float]) -> Points:
    """(3, 3) inverse covariance of equal deviation in x and y [m], and of the angle [rad]."""
    return _diagonal(deviation[0] ** -2.0, deviation[1] ** -2.0)


def _diagonal(place: float, turn: float) -> Points:
    return np.array([[place, 0.0, 0.0], [0.0, place, 0.0], [0.0, 0.0, turn]])
