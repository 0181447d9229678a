"""How fast `slam` is, beside peers that install from PyPI, on the same scans in the same run.

python benchmarks/speed.py [LOG...] [--peers-python VENV/bin/python] [--runs 3] [--json FILE]

Simulated logs of 181, 361 and 1,081 beams, and logs of your own; one and three levels, with and
without loop closure. Each run has a process of its own on one core (where the system lets a
process choose; one row has all cores, as a user has), the first is not counted, and medians are
printed: a report, not a test.
The peers (pip install kiss-icp small_gicp, best into an environment of their own) only track:
they are fed with the points of the same scans, made beforehand, and odometry as a guess.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import startup
from cases import recorded_case
from judging import trajectory_figure

from bsmap_cli.evaluation.relations import Relations
from bsmap_cli.exchange.log_writers import write_log
from bsmap_cli.exchange.tum import read_tum, write_tum
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.sensor.gate import SensorSettings, find_returns
from bsmap_cli.sensor.simulator.simulation import simulate
from bsmap_cli.sensor.trajectory import Trajectory

HERE = Path(__file__).parent
LIDARS = ("lms200", "lms200half", "ust10lx")
ALL_CORES = "3 levels, all cores"
CONFIGURATIONS: dict[str, tuple[str, ...]] = {
    "3 levels": (),
    ALL_CORES: (),
    "3 levels, no loops": ("loops.enabled=false",),
    "1 level": ("ladder=[0.1]",),
    "1 level, no loops": ("ladder=[0.1]", "loops.enabled=false"),
}
STAGES = ("read", "fit", "register", "merge", "loops", "graph", "final_map", "write")
PEERS = ("kiss-icp", "small_gicp", "small_gicp, 3 layers")
ENVIRONMENT = dict.fromkeys(
    ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


def measured(command: list[str], *, on_one_core: bool) -> dict[str, Any]:
    """What a child process prints as JSON; on one core where the system can say so."""
    setaffinity = getattr(os, "sched_setaffinity", None) if on_one_core else None
    core = max(os.sched_getaffinity(0)) if setaffinity else 0
    done = subprocess.run(
        command,
        check=True,
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, **ENVIRONMENT},
        preexec_fn=(lambda: setaffinity(0, {core})) if setaffinity else None,
    )
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def measured_in_turn(commands: dict[str, list[str]], runs: int) -> dict[str, dict[str, Any]]:
    """The median of each figure over `runs` rounds; one more comes first and is not counted.

    In each round every command runs once: where the machine is slower for a while, it is so for
    all of them. A command that does not run is left out.
    """
    reports: dict[str, list[dict[str, Any]]] = {name: [] for name in commands}
    for _ in range(runs + 1):
        for name in list(reports):
            try:
                one = measured(commands[name], on_one_core=name != ALL_CORES)
                reports[name].append(one)
            except (OSError, subprocess.CalledProcessError):
                print(f"  {name} does not run: {' '.join(commands[name])}", file=sys.stderr)
                del reports[name]
    return {name: _median_of(found[1:]) for name, found in reports.items()}


def _median_of(values: list[Any]) -> Any:
    if isinstance(values[0], dict):
        return {name: _median_of([value[name] for value in values]) for name in values[0]}
    if isinstance(values[0], int | float):
        return statistics.median(values)
    return values[0]


def simulated_logs(folder: Path) -> Iterator[Path]:
    """The loop scene as each of the lidars sees it, with its truth beside it."""
    for lidar in LIDARS:
        simulation = simulate("loop", lidar=lidar, seed=1)
        path = folder / f"loop-{simulation.lidar.beams}.mcap"
        write_log(path, simulation.scans(), "mcap")
        with path.with_suffix(".truth.tum").open("w", newline="\n") as stream:
            write_tum(stream, simulation.truth)
        yield path


def write_points(log: Path, target: Path) -> Trajectory:
    """What the peers read; the stamps of the scans come back with poses of zero."""
    clouds, stamps, steps = [], [], []
    last: SE2 | None = None
    with open_log([log], ReadOptions()) as reader:
        for scan in reader.scans():
            points = find_returns(scan, SensorSettings(), 0.1).points_body
            clouds.append(np.column_stack((points, np.zeros(len(points)))))
            stamps.append(scan.stamp_ns)
            pose = scan.pose_odom_base
            step = SE2.identity() if pose is None or last is None else last.inverse() @ pose
            last = pose
            steps.append(_matrix(step))
    starts = np.cumsum([0, *map(len, clouds)])
    guesses = np.array(steps) if last is not None else np.zeros((0, 4, 4))
    np.savez(target, points=np.concatenate(clouds), starts=starts, guesses=guesses)
    return Trajectory(np.array(stamps, np.int64), np.zeros((len(stamps), 3)))


def _matrix(step: SE2) -> Any:
    matrix = np.eye(4)
    cos, sin = np.cos(step.theta), np.sin(step.theta)
    matrix[:2, :2] = (cos, -sin), (sin, cos)
    matrix[0, 3], matrix[1, 3] = step.x, step.y
    return matrix


def measure_log(log: Path, folder: Path, peers_python: str, runs: int) -> dict[str, dict[str, Any]]:
    """Each configuration of `slam`, then each peer: name and figures, with the error in cm."""
    case = recorded_case(log, odometry=True)
    reference: Trajectory | Relations | None = case.truth or case.relations
    points = folder / "points.npz"
    stamps = write_points(log, points).stamps_ns
    commands, poses = {}, {}
    for name, changes in CONFIGURATIONS.items():
        poses[name] = folder / f"{len(poses)}.tum"
        settings = [part for change in changes for part in ("--set", change)]
        run = [sys.executable, str(HERE / "measured_run.py"), str(log), "--traj", str(poses[name])]
        commands[name] = [*run, *settings]
    for peer in PEERS:
        poses[peer] = folder / f"{len(poses)}.npy"
        run = [peers_python, str(HERE / "measured_peer.py"), peer, str(points), str(poses[peer])]
        commands[peer] = run
    rows = measured_in_turn(commands, runs)
    for name, figures in rows.items():
        if name in PEERS:
            figures["tracking_scans_per_second"] = len(stamps) / figures["seconds"]
            found = Trajectory(stamps, np.load(poses[name]))
        else:
            with poses[name].open(encoding="utf-8") as stream:
                found = read_tum(stream)
        figures["error_cm"] = 100.0 * trajectory_figure(found, reference)
    return rows


def print_log(name: str, rows: dict[str, dict[str, Any]]) -> None:
    """The table of one log: a ratio is the tracking of `slam` with three levels over the row's."""
    print(f"\n{name}")
    head = f"{'':<22}{'scans/s':>9}{'ratio':>7}{'whole s':>9}{'MB':>6}{'error cm':>10}"
    print(head + "".join(f"{stage:>10}" for stage in STAGES))
    ours = rows["3 levels"]["tracking_scans_per_second"]
    for row, figures in rows.items():
        rate, whole = figures["tracking_scans_per_second"], figures["seconds"]
        print(f"{row:<22}{rate:>9.0f}{ours / rate:>7.2f}", end="")
        print(f"{whole:>9.2f}{figures['peak_memory_mb']:>6.0f}{figures['error_cm']:>10.2f}", end="")
        stages = figures.get("stage_seconds", {})
        print("".join(f"{stages[stage]:>10.2f}" for stage in STAGES if stage in stages), flush=True)


def print_startup() -> dict[str, float]:
    """Seconds until `bsmap --help` and `bsmap stats` are done."""
    with tempfile.TemporaryDirectory() as folder:
        made = f"{folder}/map.bsm"
        log = str(HERE.parent / "sample_logs" / "spin.bag")
        subprocess.run([startup.BSMAP, "slam", log, "-o", made], check=True, capture_output=True)
        found = {
            name: statistics.median(startup.timed(*arguments))
            for name, arguments in {
                "bsmap --help": ("--help",),
                "bsmap stats": ("stats", made),
            }.items()
        }
    for name, seconds in found.items():
        print(f"{name:<22}{seconds:>9.3f} s")
    return found


def main() -> None:
    """Print a table for each log as soon as it is measured."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("logs", nargs="*", type=Path, help="logs with a truth or relations beside")
    parser.add_argument("--no-scenes", action="store_true", help="only these logs")
    parser.add_argument("--peers-python", default=sys.executable, metavar="PYTHON")
    parser.add_argument("--runs", type=int, default=3, help="how many the medians are of")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures")
    arguments = parser.parse_args()
    found: dict[str, Any] = {"startup": print_startup(), "logs": {}}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        logs = list(arguments.logs)
        if not arguments.no_scenes:
            logs = [*simulated_logs(folder), *logs]
        for log in logs:
            rows = measure_log(log, folder, arguments.peers_python, arguments.runs)
            found["logs"][log.name] = rows
            print_log(log.name, rows)
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
