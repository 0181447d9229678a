"""Whether work and memory stay flat along a long log.

python benchmarks/long_log.py [--laps 1] [--lidar lms200] [--rate HZ] [--set KEY=VALUE]...

The log is made for it: so many times round the `campus` scene, 2 km each. A row for each tenth
of the scans: processor seconds of reading, tracking and the search for loops together, and
keyframes, submaps and memory by then; at the end the last tenth against the first, and the error
of the trajectory.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
from pathlib import Path
from time import process_time

from judging import trajectory_figure
from measured_run import WARM_UP, measured

from bsmap_cli.config import load_settings
from bsmap_cli.exchange.log_writers import write_log
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.pipeline import run_slam
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.simulator.scenes.outdoors import campus
from bsmap_cli.sensor.simulator.simulation import simulate
from bsmap_cli.sensor.trajectory import Trajectory
from bsmap_cli.slam.slam import Slam

TENTHS = 10


def peak_memory_mb() -> float:
    """The most memory this process has held."""
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / (1e6 if sys.platform == "darwin" else 1e3)


class Tenths:
    """Prints a row whenever another tenth of the scans is through."""

    def __init__(self, scans: int) -> None:
        self.seconds: list[float] = []
        self._every = max(1, scans // TENTHS)
        self._count, self._began = 0, process_time()
        print(f"{'scans':>9}{'cpu s':>9}{'scans/s':>9}{'keyframes':>11}{'submaps':>9}{'MB':>7}")

    def scan(self, scan: Scan, slam: Slam) -> None:
        """A scan is through."""
        self._count += 1
        if self._count % self._every:
            return
        spent, view = process_time() - self._began, slam.view()
        self.seconds.append(spent)
        sizes = (len(view.keyframes), len(view.submaps)) if view else (0, 0)
        print(f"{self._count:>9}{spent:>9.2f}{self._every / spent:>9.0f}", end="")
        print(f"{sizes[0]:>11}{sizes[1]:>9}{peak_memory_mb():>7.0f}", flush=True)
        self._began = process_time()

    def finished(self, document: MapDocument, trajectory: Trajectory) -> None:
        """The map is finished."""
        spent = process_time() - self._began
        print(f"{'the end':>9}{spent:>9.2f}{'':>29}{peak_memory_mb():>7.0f}")


def main() -> None:
    """Make a log and run once over it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--laps", type=int, default=1)
    parser.add_argument("--lidar", default="lms200")
    parser.add_argument("--rate", type=float, help="scans a second, instead of the lidar's own")
    parser.add_argument("--odom", default="auto")
    parser.add_argument("--set", action="append", default=[])
    arguments = parser.parse_args()
    settings = load_settings(overrides=arguments.set)
    simulation = simulate(campus(arguments.laps), lidar=arguments.lidar, rate_hz=arguments.rate)
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.mcap"
        with log.open("wb") as stream:
            write_log(stream, simulation.scans(), "mcap")
        measured(WARM_UP, settings, "auto")  # compiles, or loads what is compiled
        tenths = Tenths(len(simulation))
        with open_log([log], ReadOptions(odom=arguments.odom)) as reader:
            run = run_slam(reader, settings, onlooker=tenths)
    names = ("travelled_m", "loops", "loops_tried", "loops_rejected")
    lost = sum(stretch["scans"] for stretch in run.figures["tracking_lost"])
    print(
        f"last tenth / first: {tenths.seconds[-1] / tenths.seconds[0]:.2f},"
        f" { ({name: run.figures[name] for name in names}) }, lost {lost}"
    )
    print(f"error {trajectory_figure(run.trajectory, simulation.truth):.3f} m (ATE)")


if __name__ == "__main__":
    main()
