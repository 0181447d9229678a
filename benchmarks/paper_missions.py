"""The two missions of the paper, each with one knot step and with the ladder."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product
from time import process_time

import numpy as np
from cases import SimulatedLog

from bsmap_cli.config import Settings, load_settings
from bsmap_cli.evaluation.map_statistics import sizes_of
from bsmap_cli.evaluation.pose_arrays import relative_poses, transform_poses
from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.mapper import Mapper
from bsmap_cli.pipeline import run_slam
from bsmap_cli.sensor.simulator.simulation import Simulation, simulate

MISSIONS = ("wall", "spin")
LADDERS = {"0.4": (0.4,), "0.2": (0.2,), "0.1": (0.1,), "ladder": (0.4, 0.2, 0.1)}
PROFILES = ("paper", "default")
NOISES_M = (0.0, 0.01)


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionRun:
    """One run, in the frame of its first pose.

    seconds, metres, degrees : (n,) time, and the error of each scan's pose. truth : (n, 3) true
    poses. path_m : true way. update_ms : processor time a scan, for the map update alone
    (Algorithm 1 with the true poses); slam_ms : for everything.
    """

    mission: str
    profile: str
    noise_m: float
    ladder: str
    document: MapDocument
    truth: Points
    estimate: Points
    seconds: Vector
    metres: Vector
    degrees: Vector
    path_m: float
    bytes: int
    update_ms: float
    slam_ms: float

    @property
    def control_points(self) -> int:
        """Of the finest level."""
        return len(self.document.finest.weights)


def mission_runs(
    missions: tuple[str, ...], ladders: tuple[str, ...], share: float
) -> Iterator[MissionRun]:
    """All runs; share : of each mission, from its beginning."""
    for mission, noise_m in product(missions, NOISES_M):
        simulation = beginning_of(simulate(mission, noise_m=noise_m, odometry=False), share)
        for profile, ladder in product(PROFILES, ladders):
            yield run_mission(simulation, profile, ladder, noise_m)


def compile_kernels() -> None:
    """Let the first run not pay for all."""
    for profile in PROFILES:
        run_mission(beginning_of(simulate("spin", odometry=False), 0.1), profile, "ladder", 0.01)


def beginning_of(simulation: Simulation, share: float) -> Simulation:
    """The first part of a simulation."""
    count = max(2, round(share * len(simulation)))
    truth = simulation.truth
    return replace(
        simulation,
        truth=replace(truth, stamps_ns=truth.stamps_ns[:count], poses=truth.poses[:count]),
    )


def run_mission(simulation: Simulation, profile: str, ladder: str, noise_m: float) -> MissionRun:
    """Drive once."""
    settings = replace(load_settings(profile), ladder=LADDERS[ladder])
    count = len(simulation)
    began = process_time()
    run = run_slam(SimulatedLog(simulation, np.ones(count, bool)), settings)
    slam_s = process_time() - began
    start = SE2.from_array(simulation.truth.poses[0])
    truth = transform_poses(start.inverse(), simulation.truth.poses)
    error = relative_poses(truth, run.trajectory.poses)
    stamps = simulation.truth.stamps_ns
    return MissionRun(
        mission=simulation.scene,
        profile=profile,
        noise_m=noise_m,
        ladder=ladder,
        document=run.document,
        truth=truth,
        estimate=run.trajectory.poses,
        seconds=1e-9 * (stamps - stamps[0]),
        metres=np.hypot(error[:, 0], error[:, 1]),
        degrees=np.degrees(np.abs(error[:, 2])),
        path_m=float(np.hypot(*np.diff(truth[:, :2], axis=0).T).sum()),
        bytes=sizes_of(run.document).level_bytes[-1],
        update_ms=1e3 * update_seconds(simulation, settings) / count,
        slam_ms=1e3 * slam_s / count,
    )


def update_seconds(simulation: Simulation, settings: Settings) -> float:
    """Time of Algorithm 1 over all scans at their true poses, all levels."""
    mapper, seconds = Mapper(settings), 0.0
    for scan, pose in zip(simulation.scans(), simulation.truth.poses, strict=True):
        pose_map_base = SE2.from_array(pose)
        began = process_time()
        mapper.insert(scan, pose_map_base)
        seconds += process_time() - began
    return seconds
