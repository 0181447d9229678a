"""What is measured: simulated runs with their truth, and logs with a truth or relations beside."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

from bsmap_cli.errors import UsageError
from bsmap_cli.evaluation.relations import Relations, parse_relations
from bsmap_cli.exchange.tum import read_tum
from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import LogInfo, LogReader, ReadOptions, ReadReport
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.simulator.simulation import Simulation, simulate
from bsmap_cli.sensor.trajectory import Trajectory

SCENES = ("loop", "corridor", "twins", "hallway", "office", "wall", "spin")
LONG = ("campus",)
LIDARS = ("ust10lx", "lms200", "urg04lx", "lowcost360")
AHEAD = SE2(0.8, 0.0, 0.0)
SPARSE_M = 1.0
GAP_S, GAP_RAD = 3.0, np.radians(60.0)
LOG_SUFFIXES = (".clf", ".log", ".bag", ".mcap", ".csv", ".db3")


@dataclass(frozen=True, slots=True)
class Case:
    """One log. truth, relations, surfaces : what it is judged by, where known; see `Judged`."""

    name: str
    open: Callable[[], LogReader]
    truth: Trajectory | None = None
    relations: Relations | None = None
    surfaces: Callable[[], list[Points]] | None = None


@dataclass(slots=True)
class SimulatedLog:
    """A `LogReader` of a simulation; `kept` tells which scans the log has."""

    simulation: Simulation
    kept: np.ndarray
    report: ReadReport = field(default_factory=ReadReport)
    is_stream: bool = False

    def __enter__(self) -> LogReader:
        return self

    def __exit__(self, *exc: object) -> None:
        pass

    def scans(self) -> Iterator[Scan]:
        """The kept scans."""
        self.report.odometry = "none" if self.simulation.odometry is None else "simulated"
        for scan, kept in zip(self.simulation.scans(), self.kept, strict=True):
            if kept:
                self.report.scans_read += 1
                yield scan

    def info(self) -> LogInfo:
        """Nothing asks for it."""
        raise NotImplementedError


def simulated_case(
    scene: str, lidar: str, *, odometry: bool, variant: str = "", seed: int = 1
) -> Case:
    """A run through a scene. variant : "ahead", "sparse", "gap", or nothing of the kind."""
    simulation = simulate(
        scene,
        lidar=lidar,
        odometry=odometry,
        seed=seed,
        step_m=SPARSE_M if variant == "sparse" else None,
        pose_base_laser=AHEAD if variant == "ahead" else SE2.identity(),
    )
    kept = np.ones(len(simulation), bool)
    if variant == "gap":
        kept = outside_gap(simulation.truth)
    truth = Trajectory(simulation.truth.stamps_ns[kept], simulation.truth.poses[kept])
    parts = [scene, lidar, "odom" if odometry else "none", *([variant] if variant else [])]
    return Case(
        "/".join(parts),
        partial(SimulatedLog, simulation, kept),
        truth=truth,
        surfaces=lambda: [surface.points for surface in simulation.world.surfaces()],
    )


def outside_gap(truth: Trajectory) -> np.ndarray:
    """(n,) bool: all but the 3 s in which the base turned by about 60 degrees, late in the run."""
    times = (truth.stamps_ns - truth.stamps_ns[0]) * 1e-9
    heading = np.unwrap(truth.poses[:, 2])
    begin = np.flatnonzero((times > 0.3 * times[-1]) & (times < 0.9 * times[-1] - GAP_S))
    end = np.minimum(np.searchsorted(times, times[begin] + GAP_S), len(times) - 1)
    turned = np.abs(heading[end] - heading[begin])
    first = begin[np.argmin(np.abs(turned - GAP_RAD))]
    kept: np.ndarray = ~((times > times[first]) & (times < times[first] + GAP_S))
    return kept


def simulated_cases(
    scenes: tuple[str, ...], lidars: tuple[str, ...]
) -> Iterator[Callable[[], Case]]:
    """Each scene with each lidar, with and without odometry, then the awkward variants."""
    for scene, lidar, odometry in product(scenes, lidars, (True, False)):
        yield partial(simulated_case, scene, lidar, odometry=odometry)
    awkward = [scene for scene in scenes if scene in ("loop", "office", "hallway", "campus")]
    for scene, lidar, variant in product(awkward, lidars, ("ahead", "sparse", "gap")):
        for odometry in (True, False):
            yield partial(simulated_case, scene, lidar, odometry=odometry, variant=variant)


def logs_in(paths: list[Path]) -> list[Path]:
    """The logs among files and folders: in folders, those with a truth or relations beside them."""
    found = []
    for path in paths:
        inside = sorted(path.iterdir()) if path.is_dir() else [path]
        found += [p for p in inside if not path.is_dir() or (_is_log(p) and _companions(p))]
    return found


def recorded_case(path: Path, *, odometry: bool) -> Case:
    """A log; its truth (`*.tum`) or relations (`*.relations`) begin with the same stem."""
    options = ReadOptions(odom="auto" if odometry else "none")
    truth = relations = None
    for beside in _companions(path):
        with beside.open(encoding="utf-8") as lines:
            if beside.suffix == ".tum":
                truth = read_tum(lines)
            else:
                relations = parse_relations(lines)
    if truth is None and relations is None:
        raise UsageError(
            f"{path} has no {_stem(path)}.relations or {_stem(path)}.truth.tum beside it"
        )
    return Case(
        f"{_stem(path)}/{'odom' if odometry else 'none'}",
        lambda: open_log([path], options),
        truth=None if relations is not None else truth,
        relations=relations,
    )


def _stem(path: Path) -> str:
    return path.name.partition(".")[0]


def _is_log(path: Path) -> bool:
    return any(suffix in LOG_SUFFIXES for suffix in path.suffixes)


def _companions(path: Path) -> list[Path]:
    beside = path.parent.glob(f"{_stem(path)}.*")
    return sorted(p for p in beside if p.suffix in (".relations", ".tum"))
