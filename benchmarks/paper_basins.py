"""From how far off each way of registering finds the pose again, on a map with known poses."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from bsmap_cli.config import Settings, load_settings
from bsmap_cli.geometry.se2 import SE2, Vector, wrap_angle
from bsmap_cli.mapping.mapper import Mapper
from bsmap_cli.mapping.scan_levels import Segmenter
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.sensor.simulator.simulation import simulate
from bsmap_cli.slam.ladder import track_down

PLACES = (("wall", "ust10lx"), ("spin", "ust10lx"), ("shapes", "ust10lx"), ("loop", "lms200"))
METHODS = ("points", "joint_first", "joint")
OFF = ((0.1, 3.0), (0.3, 8.0), (0.5, 15.0), (0.8, 20.0))  # metres, degrees
NOISE_M = 0.01
MAPPED, ASKED, TIMES = 300, 45, 3  # scans in the map, scans asked about, starts for each
FOUND_M, FOUND_DEG = 0.03, 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Basin:
    """Share of the starts that lead home, and the time of one registration."""

    scene: str
    lidar: str
    off_m: float
    off_deg: float
    method: str
    found: float
    ms: float


def basins() -> Iterator[Basin]:
    """Every place, distance and method; the ladder and all else as the default profile has them."""
    for scene, lidar in PLACES:
        mapper, asked = _mapped(scene, lidar)
        for off in OFF:
            starts = [pose + away for _, pose in asked for away in _aways(off)]
            for method in METHODS:
                settings = load_settings("default", overrides=[f"registration.method={method}"])
                found, began = 0, process_time()
                for k, start in enumerate(starts):
                    clusters, pose = asked[k // TIMES]
                    found += _is_home(_register(mapper, clusters, start, off, settings), pose)
                yield Basin(
                    scene=scene,
                    lidar=lidar,
                    off_m=off[0],
                    off_deg=off[1],
                    method=method,
                    found=found / len(starts),
                    ms=1e3 * (process_time() - began) / len(starts),
                )


def _aways(off: tuple[float, float]) -> list[Vector]:
    """So far off in so many directions, turned one way and the other."""
    ways = 2.0 * math.pi * (np.arange(TIMES) + 0.3) / TIMES
    turn = math.radians(off[1])
    return [
        np.array([off[0] * math.cos(way), off[0] * math.sin(way), turn * (-1) ** k])
        for k, way in enumerate(ways)
    ]


def _mapped(scene: str, lidar: str) -> tuple[Mapper, list[tuple[Sequence[Clusters], Vector]]]:
    """A map from true poses, and scans that are not in it."""
    simulation = simulate(scene, lidar=lidar, noise_m=NOISE_M, odometry=False)
    settings = load_settings("default")
    mapper, asked = Mapper(settings), []
    segmenter = Segmenter(settings)
    every = max(4, len(simulation) // MAPPED)
    other = max(4, len(simulation) // ASKED)
    for k, (scan, pose) in enumerate(zip(simulation.scans(), simulation.truth.poses, strict=True)):
        if k % every == 0:
            mapper.insert(scan, SE2.from_array(pose))
        elif k % other == 1:
            asked.append((segmenter.levels(scan, NOISE_M), pose))
    return mapper, asked


def _register(
    mapper: Mapper,
    clusters: Sequence[Clusters],
    start: Vector,
    off: tuple[float, float],
    settings: Settings,
) -> Vector:
    information = np.diag([off[0] ** -2.0] * 2 + [math.radians(off[1]) ** -2.0])
    result = track_down(
        mapper.levels,
        clusters,
        start,
        start,
        information,
        enough=settings.registration.shortcut,
        sigma_m=NOISE_M,
        settings=settings,
    )
    return result.pose


def _is_home(end: Vector, pose: Vector) -> bool:
    near = math.hypot(end[0] - pose[0], end[1] - pose[1]) < FOUND_M
    return near and abs(math.degrees(wrap_angle(float(end[2] - pose[2])))) < FOUND_DEG
