"""What `slam` makes of the sample logs, beside their truth.

python benchmarks/sample_figures.py [--write sample_logs/README.md]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from pages import length, markdown, write_table

from bsmap_cli.config import load_settings
from bsmap_cli.evaluation.map_statistics import map_statistics, sizes_of
from bsmap_cli.evaluation.trajectory_error import absolute_error, match_poses
from bsmap_cli.exchange.tum import read_tum
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.pipeline import run_slam
from bsmap_cli.sensor.trajectory import Trajectory

FOLDER = Path(__file__).parent.parent / "sample_logs"
LOGS = (
    *("wall.mcap", "spin.bag", "shapes.mcap", "loop.csv.gz", "loop-sparse.mcap"),
    *("corridor.mcap", "twins.bag"),
)
NAMES = (
    *("log", "ATE rmse", "last pose", "odometry: ATE rmse", "loops closed"),
    *("curves", "control points", "bytes", "compressed"),
)


def main() -> None:
    """Print the table, and put it on a page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--write", type=Path, metavar="PAGE", help="also put it on this page")
    page = parser.parse_args().write
    table = markdown(NAMES, rows())
    if page:
        write_table(page, "figures", table)


def rows() -> Iterator[tuple[object, ...]]:
    """One a log."""
    for name in LOGS:
        with (FOLDER / f"{name.partition('.')[0]}.truth.tum").open() as lines:
            truth = read_tum(lines)
        with open_log([FOLDER / name], ReadOptions()) as reader:
            run = run_slam(reader, load_settings())
        found = map_statistics(run.document, sizes_of(run.document))
        metres, degrees = last_pose(run.trajectory, truth)
        odometry = odometry_of(name)
        yield (
            f"`{name}`",
            length(ate_m(run.trajectory, truth)),
            f"{length(metres)}, {degrees:.2f}°",
            length(ate_m(odometry, truth)) if odometry else "",
            run.figures["loops"],
            found.curves,
            found.control_points,
            found.payload_bytes,
            sizes_of(run.document, compress=True).level_bytes[-1],
        )


def odometry_of(name: str) -> Trajectory | None:
    """What the wheels say, where the log has it."""
    with open_log([FOLDER / name], ReadOptions()) as reader:
        scans = [(scan.stamp_ns, scan.pose_odom_base) for scan in reader.scans()]
    poses = [pose.as_array() for _, pose in scans if pose is not None]
    if len(poses) < len(scans):
        return None
    return Trajectory(np.array([stamp for stamp, _ in scans], np.int64), np.array(poses))


def ate_m(trajectory: Trajectory, truth: Trajectory) -> float:
    """Absolute trajectory error, root mean square [m]."""
    return absolute_error(match_poses(trajectory, truth)).as_json()["rmse_m"]


def last_pose(trajectory: Trajectory, truth: Trajectory) -> tuple[float, float]:
    """Error of the last pose in the frame of the first [m], [deg]."""
    ends = [
        SE2.from_array(poses[0]).inverse() @ SE2.from_array(poses[-1])
        for poses in (trajectory.poses, truth.poses)
    ]
    error = ends[1].inverse() @ ends[0]
    return float(np.hypot(error.x, error.y)), abs(float(np.degrees(error.theta)))


if __name__ == "__main__":
    main()
