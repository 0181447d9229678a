"""One `slam` run, measured in a process of its own; prints its report as JSON.

python benchmarks/measured_run.py LOG [--set KEY=VALUE]... [--traj FILE] [--odom none]

A run of a small log comes first and is not counted: it compiles, or loads what is compiled.
"""

from __future__ import annotations

import argparse
import json
from io import BytesIO
from pathlib import Path
from time import perf_counter
from typing import Any

from bsmap_cli.cli.door import collect_seldom
from bsmap_cli.config import Settings, load_settings
from bsmap_cli.exchange.tum import write_tum
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.mapping.map_file import write_map
from bsmap_cli.pipeline import Run, full_report, run_slam

WARM_UP = Path(__file__).parent.parent / "sample_logs" / "loop.csv.gz"


def measured(log: Path, settings: Settings, odometry: str) -> tuple[Run, dict[str, Any]]:
    """A run from opening the log to the bytes of the map, and its report."""
    began = perf_counter()
    with open_log([log], ReadOptions(odom=odometry)) as reader:
        run = run_slam(reader, settings)
    ran = perf_counter()
    encoded = BytesIO()
    write_map(encoded, run.document)
    ended = perf_counter()
    return run, full_report(run, seconds=ended - began, write_s=ended - ran)


def main() -> None:
    """Warm up, measure, print."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("log", type=Path)
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--traj", type=Path)
    parser.add_argument("--odom", default="auto")
    arguments = parser.parse_args()
    settings = load_settings(overrides=arguments.set)
    collect_seldom()  # as the command does
    measured(WARM_UP, settings, "auto")
    run, report = measured(arguments.log, settings, arguments.odom)
    if arguments.traj:
        with arguments.traj.open("w", newline="\n") as stream:
            write_tum(stream, run.trajectory)
    del report["settings"], report["map"]
    print(json.dumps(report))


if __name__ == "__main__":
    main()
