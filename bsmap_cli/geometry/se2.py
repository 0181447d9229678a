"""Rigid motions of the plane, eq. (2)."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Vector = NDArray[np.float64]


def wrap_angle(angle_rad: float) -> float:
    """The same angle in (-pi, pi]."""
    wrapped = math.remainder(angle_rad, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


class SE2(NamedTuple):
    """Rigid motion `(x, y, theta)`: metres and radians, theta in (-pi, pi].

    `pose_a_b @ points_b -> points_a`; `pose_a_b @ pose_b_c -> pose_a_c`. The paper's
    `xi + delta` adds in these coordinates; it is not the exponential map.
    """

    x: float
    y: float
    theta: float

    @classmethod
    def identity(cls) -> SE2:
        """The motion that changes nothing."""
        return cls(0.0, 0.0, 0.0)

    @classmethod
    def from_array(cls, xytheta: Iterable[float]) -> SE2:
        """From three numbers x [m], y [m], theta [rad]; theta is wrapped."""
        x, y, theta = xytheta.tolist() if isinstance(xytheta, np.ndarray) else map(float, xytheta)
        return cls(x, y, wrap_angle(theta))

    def as_array(self) -> Vector:
        """(3,) float64: x, y, theta."""
        return np.array(tuple(self))  # as a plain tuple numpy reads it faster

    def inverse(self) -> SE2:
        """The motion back."""
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        return SE2(
            -cos * self.x - sin * self.y, sin * self.x - cos * self.y, wrap_angle(-self.theta)
        )

    def relative_to(self, origin: SE2) -> SE2:
        """`origin.inverse() @ self`: this pose in the frame of another one."""
        x, y, theta = self
        origin_x, origin_y, turned = origin
        cos, sin = math.cos(turned), math.sin(turned)
        dx, dy = x - origin_x, y - origin_y
        return SE2(cos * dx + sin * dy, cos * dy - sin * dx, wrap_angle(theta - turned))

    def transform(self, points: Points) -> Points:
        """Eq. (2): (m, 2) points of the inner frame, expressed in the outer one [m]."""
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        x, y = points[..., 0], points[..., 1]
        return np.stack((cos * x - sin * y + self.x, sin * x + cos * y + self.y), axis=-1)

    def __matmul__(self, other: SE2) -> SE2:
        x, y, theta = self
        dx, dy, turn = other
        cos, sin = math.cos(theta), math.sin(theta)
        return SE2(x + cos * dx - sin * dy, y + sin * dx + cos * dy, wrap_angle(theta + turn))
