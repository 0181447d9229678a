"""How fast logs are read: scans and megabytes a second, with odometry and without.

python benchmarks/reading.py LOG... [--runs 3]

The best of several runs in one process; nothing is done with the scans.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from time import perf_counter

from bsmap_cli.cli.door import collect_seldom
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions


def seconds_to_read(log: Path, odometry: str) -> tuple[int, float]:
    """Scans of a log, and how long it took to read them."""
    began = perf_counter()
    with open_log([log], ReadOptions(odom=odometry)) as reader:
        scans = sum(1 for _ in reader.scans())
    return scans, perf_counter() - began


def main() -> None:
    """Print a line for each log and each way to read it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("logs", nargs="+", type=Path)
    parser.add_argument("--runs", type=int, default=3)
    arguments = parser.parse_args()
    collect_seldom()  # as the command does
    print(f"{'':<32}{'odometry':>9}{'scans':>8}{'scans/s':>9}{'MB/s':>7}")
    for log in arguments.logs:
        files = [log] if log.is_file() else [path for path in log.rglob("*") if path.is_file()]
        megabytes = sum(path.stat().st_size for path in files) / 1e6
        for odometry in ("auto", "none"):
            read = [seconds_to_read(log, odometry) for _ in range(arguments.runs)]
            scans, seconds = min(read, key=lambda one: one[1])
            print(f"{log.name:<32}{odometry:>9}{scans:>8}", end="")
            print(f"{scans / seconds:>9.0f}{megabytes / seconds:>7.1f}")


if __name__ == "__main__":
    main()
