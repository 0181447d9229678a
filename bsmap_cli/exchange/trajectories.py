"""Trajectories in any format: written by name, read by content."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import chain
from typing import TextIO

from bsmap_cli.exchange.kitti import write_kitti
from bsmap_cli.exchange.trajectory_csv import read_trajectory_csv, write_trajectory_csv
from bsmap_cli.exchange.trajectory_json import read_trajectory_json, write_trajectory_json
from bsmap_cli.exchange.tum import read_tum, write_tum
from bsmap_cli.sensor.trajectory import Trajectory

WRITERS: dict[str, Callable[[TextIO, Trajectory], None]] = {
    "tum": write_tum,
    "kitti": write_kitti,
    "csv": write_trajectory_csv,
    "json": write_trajectory_json,
}


def read_trajectory(lines: Iterable[str]) -> Trajectory:
    """A trajectory in TUM, CSV or JSON: the first line that says something decides.

    LogError names the line that is not a pose.
    """
    rest = iter(lines)
    skipped: list[str] = []
    for line in rest:
        start = line.lstrip("\ufeff \t")
        if start.strip() and not start.startswith("#"):
            if start.startswith("{"):
                return read_trajectory_json("".join(chain([start], rest)))
            if start[0].isalpha() and "," in start:
                return read_trajectory_csv(chain([start], rest))
            return read_tum(chain(skipped, [start], rest))
        skipped.append(line)
    return read_tum(skipped)
