"""Trajectories as JSON: `{"frame": ..., "poses": [{stamp_ns, x_m, y_m, yaw_rad}, ...]}`."""

from __future__ import annotations

import json
from typing import TextIO

import numpy as np

from bsmap_cli.errors import LogError
from bsmap_cli.sensor.trajectory import Trajectory


def write_trajectory_json(stream: TextIO, trajectory: Trajectory, *, frame: str = "map") -> None:
    """A line for each pose of the base in `frame`, in the order of the log."""
    poses = trajectory.poses.tolist()
    lines = [
        f'{{"stamp_ns":{stamp_ns},"x_m":{x:.9f},"y_m":{y:.9f},"yaw_rad":{yaw:.9f}}}'
        for stamp_ns, (x, y, yaw) in zip(trajectory.stamps_ns.tolist(), poses, strict=True)
    ]
    rows = ",\n".join(lines)
    stream.write(f'{{"frame":{json.dumps(frame)},"poses":[\n{rows}\n]}}\n')


def read_trajectory_json(text: str) -> Trajectory:
    """What `write_trajectory_json` wrote; LogError where it is something else."""
    try:
        rows = json.loads(text)["poses"]
        stamps = np.array([int(row["stamp_ns"]) for row in rows], np.int64)
        poses = np.array([[row["x_m"], row["y_m"], row["yaw_rad"]] for row in rows], np.float64)
    except (KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise LogError(f"not a trajectory in JSON: {error!r}") from error
    if not np.isfinite(poses).all():
        raise LogError("the trajectory holds a number that is not finite")
    return Trajectory(stamps, poses.reshape(-1, 3))
