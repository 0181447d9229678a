"""Whole runs of the simulator and of logs, and how far they end from the truth."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bsmap_cli.config import load_settings
from bsmap_cli.evaluation.true_surfaces import cut_surfaces
from bsmap_cli.exchange.log_writers import write_log
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.mapping.mapper import Mapper
from bsmap_cli.pipeline import run_slam
from bsmap_cli.sensor.gate import SensorSettings, find_returns
from bsmap_cli.slam.slam import Slam

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "sample_logs"
DATA = ROOT.parent / "shared" / "data"


class End(NamedTuple):
    """Error of the last pose in the frame of the first, and the true way."""

    metres: float
    degrees: float
    way_m: float


def slam(simulation, profile="default", *overrides):
    """What `slam` makes of a simulation."""
    method = Slam(load_settings(profile, overrides=overrides))
    for scan in simulation.scans():
        method.process(scan)
    return method.finish()


def mapped(simulation, *overrides):
    """What `map` makes of a simulation with its true poses."""
    mapper = Mapper(load_settings("default", overrides=overrides))
    for scan, pose in zip(simulation.scans(), simulation.truth.poses, strict=True):
        mapper.insert(scan, SE2.from_array(pose))
    return mapper.document()


def end_of(estimate, truth):
    """Of (n, 3) poses beside the true ones."""
    ends = []
    for poses in (estimate, truth):
        ends.append(SE2.from_array(poses[0]).inverse() @ SE2.from_array(poses[-1]))
    error = ends[1].inverse() @ ends[0]
    way_m = float(np.hypot(*np.diff(truth[:, :2], axis=0).T).sum())
    return End(math.hypot(error.x, error.y), abs(math.degrees(error.theta)), way_m)


def hit_surfaces(simulation):
    """The true surfaces, and how many beams end on each of their pieces."""
    surfaces = cut_surfaces([surface.points for surface in simulation.world.surfaces()])
    ends = [
        SE2.from_array(pose).transform(find_returns(scan, SensorSettings(), 0.1).points_body)
        for scan, pose in zip(simulation.scans(), simulation.truth.poses, strict=True)
    ]
    return surfaces, surfaces.count_hits(np.concatenate(ends))


def run_log(path, *overrides, **options):
    """What `slam` makes of a log."""
    with open_log([path], ReadOptions(**options)) as reader:
        return run_slam(reader, load_settings(overrides=overrides))


def scaled(scan, factor):
    """The scan of a world so many times as large."""
    odometry = scan.pose_odom_base
    laser = scan.pose_base_laser
    return replace(
        scan,
        ranges_m=(scan.ranges_m * np.float32(factor)),
        range_min_m=factor * scan.range_min_m,
        range_max_m=factor * scan.range_max_m,
        pose_base_laser=SE2(factor * laser.x, factor * laser.y, laser.theta),
        pose_odom_base=odometry and SE2(factor * odometry.x, factor * odometry.y, odometry.theta),
    )


def write_scaled(log, target, factor):
    """A log so many times as large, as MCAP."""
    with open_log([log], ReadOptions()) as reader:
        held = io.BytesIO()
        write_log(held, (scaled(scan, factor) for scan in reader.scans()), "mcap")
    target.write_bytes(held.getvalue())
