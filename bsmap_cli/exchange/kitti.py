"""KITTI trajectories: a line of twelve numbers for each pose, without stamps."""

from __future__ import annotations

from typing import TextIO

import numpy as np

from bsmap_cli.sensor.trajectory import Trajectory


def write_kitti(stream: TextIO, trajectory: Trajectory) -> None:
    """One line for each pose: the upper three rows of its 4 x 4 matrix, row after row."""
    x, y, yaw = trajectory.poses.T
    rows = np.column_stack((np.cos(yaw), np.sin(yaw), x, y)).tolist()
    for cos, sin, x_m, y_m in rows:
        stream.write(f"{cos:.9f} {-sin:.9f} 0 {x_m:.9f} {sin:.9f} {cos:.9f} 0 {y_m:.9f} 0 0 1 0\n")
