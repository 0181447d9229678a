"""Rigid motions of the plane for compiled code, eq. (2): tuples of x [m], y [m], theta [rad].

They are those of `SE2`, but for the last digit, and for headings of either -pi or pi.
"""

from __future__ import annotations

import math

from bsmap_cli.geometry.compiled import inlined

Pose = tuple[float, float, float]


def as_pose(pose: Pose) -> Pose:
    """The same, whatever named tuple it is: numba takes each kind for a type of its own."""
    x, y, theta = pose
    return x, y, theta


@inlined
def wrapped(angle_rad: float) -> float:
    """The same angle in [-pi, pi]."""
    if -math.pi < angle_rad <= math.pi:
        return angle_rad
    if not abs(angle_rad) < math.inf:
        return angle_rad
    turns = math.ceil(angle_rad / math.tau - 0.5)
    return max(-math.pi, min(math.pi, angle_rad - turns * math.tau))


@inlined
def composed(pose_a_b: Pose, pose_b_c: Pose) -> Pose:
    """pose_a_c: `pose_a_b @ pose_b_c`."""
    x, y, theta = pose_a_b
    dx, dy, turn = pose_b_c
    cos, sin = math.cos(theta), math.sin(theta)
    return x + cos * dx - sin * dy, y + sin * dx + cos * dy, wrapped(theta + turn)


@inlined
def relative(pose: Pose, origin: Pose) -> Pose:
    """A pose in the frame of another one."""
    x, y, theta = pose
    origin_x, origin_y, turned = origin
    cos, sin = math.cos(turned), math.sin(turned)
    dx, dy = x - origin_x, y - origin_y
    return cos * dx + sin * dy, cos * dy - sin * dx, wrapped(theta - turned)
