"""Trajectories as CSV: a header row, then a row `stamp_ns,x,y,theta` for each pose."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable
from typing import TextIO

import numpy as np

from bsmap_cli.errors import LogError
from bsmap_cli.sensor.stamps import parse_stamp
from bsmap_cli.sensor.trajectory import Trajectory

HEADER = "stamp_ns,x,y,theta"
LISTED = 8  # columns in a message


def write_trajectory_csv(stream: TextIO, trajectory: Trajectory) -> None:
    """Metres and radians, in the order of the log."""
    stream.write(f"{HEADER}\n")
    poses = trajectory.poses.tolist()
    for stamp_ns, (x, y, theta) in zip(trajectory.stamps_ns.tolist(), poses, strict=True):
        stream.write(f"{stamp_ns},{x:.9f},{y:.9f},{theta:.9f}\n")


def read_trajectory_csv(lines: Iterable[str]) -> Trajectory:
    """Columns by name, in any order: `stamp_ns` or `t` [s], `x`, `y` [m], `theta` [rad].

    LogError names the column that is missing or the line that is no pose.
    """
    reader = csv.DictReader(lines, skipinitialspace=True)
    names = [name.strip() for name in reader.fieldnames or ()]
    reader.fieldnames = names
    stamp_name = "stamp_ns" if "stamp_ns" in names else "t"
    missing = [name for name in (stamp_name, "x", "y", "theta") if name not in names]
    if missing:
        more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
        raise LogError(
            f"the trajectory has no column {missing[0]}: it has {', '.join(names[:LISTED])}{more}"
        )
    stamps, poses = [], []
    for row in reader:
        try:
            text = row[stamp_name].strip()
            stamps.append(int(text) if stamp_name == "stamp_ns" else parse_stamp(text))
            pose = (float(row["x"]), float(row["y"]), float(row["theta"]))
            if not all(map(math.isfinite, pose)):
                raise ValueError("a number is not finite")
        except (AttributeError, TypeError, ValueError) as error:
            raise LogError(f"line {reader.line_num} of the trajectory: {error}") from error
        poses.append(pose)
    return Trajectory(np.array(stamps, np.int64), np.array(poses, np.float64).reshape(-1, 3))
