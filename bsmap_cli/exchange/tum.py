"""TUM trajectories: a line `stamp x y z qx qy qz qw` for each pose."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TextIO

import numpy as np

from bsmap_cli.errors import LogError
from bsmap_cli.sensor.stamps import format_stamp, parse_stamp
from bsmap_cli.sensor.trajectory import Trajectory

FIELDS = 8  # of a line


def write_tum(stream: TextIO, trajectory: Trajectory) -> None:
    """One line for each pose, in order: nine decimals of seconds from integer nanoseconds."""
    half = 0.5 * trajectory.poses[:, 2]
    rows = np.column_stack((trajectory.poses[:, :2], np.sin(half), np.cos(half))).tolist()
    for stamp_ns, (x, y, qz, qw) in zip(trajectory.stamps_ns.tolist(), rows, strict=True):
        stream.write(f"{format_stamp(stamp_ns)} {x:.9f} {y:.9f} 0 0 0 {qz:.9f} {qw:.9f}\n")


def read_tum(stream: Iterable[str]) -> Trajectory:
    """The trajectory of the lines: x, y and the yaw of the quaternion, in the order of the file.

    `#` starts a comment. LogError names the line that is not a pose.
    """
    stamps: list[int] = []
    poses: list[tuple[float, float, float]] = []
    for number, line in enumerate(stream, 1):
        fields = line.partition("#")[0].replace(",", " ").split()
        if not fields:
            continue
        form = f"line {number} of the trajectory is not `stamp x y z qx qy qz qw`"
        if len(fields) != FIELDS:
            raise LogError(f"{form}: it has {len(fields)} of {FIELDS} numbers")
        try:
            stamp, (x, y, _, qx, qy, qz, qw) = parse_stamp(fields[0]), map(float, fields[1:])
        except ValueError as error:
            raise LogError(f"{form}: {str(error)[:120]}") from error
        yaw = math.atan2(2.0 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
        if not (math.isfinite(x) and math.isfinite(y) and math.isfinite(yaw)):
            raise LogError(f"line {number} of the trajectory holds a number that is not finite")
        stamps.append(stamp)
        poses.append((x, y, yaw))
    return Trajectory(np.array(stamps, np.int64), np.array(poses, np.float64).reshape(-1, 3))
