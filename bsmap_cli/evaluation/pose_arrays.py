"""Poses as rows x [m], y [m], theta [rad]: whole trajectories at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import SE2, Vector

Poses = NDArray[np.float64]


def wrap_angles(angles_rad: Vector) -> Vector:
    """The same angles in [-pi, pi)."""
    wrapped: Vector = np.mod(angles_rad + np.pi, 2.0 * np.pi) - np.pi
    return wrapped


def relative_poses(poses_a_b: Poses, poses_a_c: Poses) -> Poses:
    """(m, 3) poses_b_c: the second of each pair in the frame of the first."""
    cos, sin = np.cos(poses_a_b[:, 2]), np.sin(poses_a_b[:, 2])
    x, y = (poses_a_c - poses_a_b)[:, :2].T
    yaw = wrap_angles(poses_a_c[:, 2] - poses_a_b[:, 2])
    return np.column_stack((cos * x + sin * y, -sin * x + cos * y, yaw))


def transform_poses(pose_a_b: SE2, poses_b_c: Poses) -> Poses:
    """(m, 3) poses_a_c: all poses moved by one rigid motion."""
    moved = pose_a_b.transform(poses_b_c[:, :2])
    return np.column_stack((moved, wrap_angles(poses_b_c[:, 2] + pose_a_b.theta)))


def nearest_stamps(
    stamps_ns: NDArray[np.int64], wanted_ns: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each wanted stamp the row of the nearest one and how far off it is [ns].

    The stamps may step back and repeat, as in real logs; of equally near rows the earlier stamp
    and then the lower row wins. There must be one stamp at least.
    """
    order = np.argsort(stamps_ns, kind="stable")
    ordered = stamps_ns[order]
    right = np.clip(np.searchsorted(ordered, wanted_ns), 0, len(ordered) - 1)
    left = np.maximum(right - 1, 0)
    take_left = np.abs(wanted_ns - ordered[left]) <= np.abs(wanted_ns - ordered[right])
    # equal stamps: the first of them in the order of the log
    place = np.searchsorted(ordered, ordered[np.where(take_left, left, right)])
    return order[place], np.abs(wanted_ns - ordered[place])
