"""Short runs that together call every kernel as real runs do, and what numba made of them.

python -m tests.pipeline.rehearsals : which kernels Python called, with the types of their
arguments, as `kernel_table.json` has them. In a process of its own with all compiled before, as
kernels that others call are else among them.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from bsmap_cli.config import load_settings
from bsmap_cli.logs.reader import LogInfo, LogReader, ReadReport
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.queries import MapQuery
from bsmap_cli.pipeline import runs as runs_module
from bsmap_cli.pipeline.kernel_table import described, name_of
from bsmap_cli.pipeline.localize import run_localize
from bsmap_cli.pipeline.runs import run_map, run_slam
from bsmap_cli.pipeline.two_maps import merge_maps, place_map
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.simulator.simulation import Simulation, simulate

SCENE, LIDAR, STEP_M, SCANS = "shapes", "lms200", 0.2, 40
# small submaps and a graph that trusts nothing: loops are searched for at once
SEARCHING = ("submaps.keyframes=4", "loops.deviations=1000", "loops.retry=0", "loops.max_reach=20")
FADING = ("visibility.method=fade", "final_map.rebuild=false")


def rehearsals() -> Iterator[Callable[[], object]]:
    """The first is what `slam` does with default settings."""
    made = simulate(SCENE, lidar=LIDAR, step_m=STEP_M, sweep=True)
    default, paper = load_settings(), load_settings("paper")
    searching = load_settings(overrides=SEARCHING)
    every_level = replace(default.final_map, all_levels=True)
    yield lambda: run_slam(Rehearsed(made), searching)
    yield lambda: run_slam(Rehearsed(made), replace(searching, final_map=every_level))
    yield lambda: run_slam(Rehearsed(made), load_settings(overrides=FADING))
    yield lambda: run_slam(Rehearsed(made), paper)
    yield lambda: run_map(Rehearsed(made), made.truth, default)
    yield lambda: run_map(Rehearsed(made), "odom", paper)
    known: MapDocument = run_map(Rehearsed(made), made.truth, default).document
    yield lambda: run_localize(Rehearsed(made), known, default)
    yield lambda: run_slam(Rehearsed(made), default, old=known)
    yield lambda: _asked(MapQuery(known.finest))
    yield lambda: merge_maps(known, known, place_map(known, known, default), default)


def _asked(query: MapQuery) -> None:
    query.nearest(np.zeros((1, 2)))
    query.rays(np.zeros((1, 2)), np.zeros(1))


class Rehearsed:
    """The first scans of a simulation as a log."""

    is_stream = False

    def __init__(self, made: Simulation) -> None:
        self.report = ReadReport()
        self._made = made

    def __enter__(self) -> LogReader:
        return self

    def __exit__(self, *exc: object) -> None:
        pass

    def scans(self) -> Iterator[Scan]:
        for number, scan in enumerate(self._made.scans()):
            if number == SCANS:
                return
            yield scan

    def info(self) -> LogInfo:
        raise NotImplementedError("nobody asks what a rehearsal holds")


def called_kernels() -> dict[str, list[Any]]:
    """The types for which each kernel stands ready in this process."""
    found = {}
    for module_name, module in sorted(sys.modules.items()):
        if module_name.split(".")[0] != "bsmap_cli":
            continue
        for value in vars(module).values():
            if hasattr(value, "py_func") and value.signatures:
                (signature,) = value.signatures  # a second one would be compiled for itself
                found[name_of(value.py_func)] = [described(one) for one in signature]
    return found


def rehearse() -> dict[str, dict[str, Any]]:
    """Entries of the table, in order of their names."""
    # what the table says now may be out of date
    runs_module.compile_for_slam = lambda: None
    # with a second core, loops are looked for in a process of which nothing is seen here
    runs_module.usable_cores = lambda: 1
    runs = rehearsals()
    next(runs)()
    in_slam = {name for name in called_kernels() if not name.startswith("sensor.simulator.")}
    for run in runs:
        run()
    return {
        name: {"in_slam": name in in_slam, "types": types}
        for name, types in sorted(called_kernels().items())
    }


if __name__ == "__main__":
    print(json.dumps(rehearse()))
