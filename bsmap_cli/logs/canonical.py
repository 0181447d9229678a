"""One spelling for numbers that every container rounds in its own way.

Angles of a scan travel as float32 in ROS and as decimal text elsewhere; a yaw travels as a
quaternion in ROS and as an angle elsewhere. Readers and writers bring both to one value, so
that the same scan leaves the same bytes whatever container it came from.
"""

from __future__ import annotations

import math
import struct
from array import array
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import SE2, wrap_angle
from bsmap_cli.sensor.scan import Ranges

YAW_STEP_RAD = 2.0**-30
"""Lattice of headings [rad]: far below any sensor, far above the rounding of a quaternion."""

_FLOAT32 = struct.Struct("<f")


def float32_value(value: float) -> float:
    """The nearest float32 value, held in float64; beyond the range of float32 an infinity."""
    try:
        return float(_FLOAT32.unpack(_FLOAT32.pack(value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


def float32_ranges(ranges_m: Sequence[float] | NDArray[np.float64]) -> Ranges:
    """(n,) ranges [m] rounded to float32; beyond its range infinities."""
    if isinstance(ranges_m, list):  # twice as fast as numpy reads it
        return np.frombuffer(array("f", ranges_m), np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.asarray(ranges_m, dtype=np.float64).astype(np.float32)


def canonical_yaw(yaw_rad: float) -> float:
    """The angle in (-pi, pi] on the lattice of `YAW_STEP_RAD`; headings next to -pi become pi."""
    wrapped = wrap_angle(yaw_rad)
    if math.pi - abs(wrapped) < YAW_STEP_RAD:
        return math.pi
    return round(wrapped / YAW_STEP_RAD) * YAW_STEP_RAD


def canonical_pose(x_m: float, y_m: float, yaw_rad: float) -> SE2:
    """A planar pose with its heading on the lattice."""
    return SE2(x_m, y_m, canonical_yaw(yaw_rad))


def yaw_of_quaternion(x: float, y: float, z: float, w: float) -> float:
    """Heading [rad] of the x axis, projected to the plane; the length of the quaternion is free."""
    return math.atan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)


def quaternion_of_yaw(yaw_rad: float) -> tuple[float, float, float, float]:
    """`(x, y, z, w)` of a turn about the vertical axis."""
    return 0.0, 0.0, math.sin(yaw_rad / 2.0), math.cos(yaw_rad / 2.0)
