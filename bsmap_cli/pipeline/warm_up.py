"""All hot loops compiled ahead of the first run: short runs through every branch of the method."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bsmap_cli.config import load_settings
from bsmap_cli.logs.reader import LogInfo, LogReader, ReadReport
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.queries import MapQuery
from bsmap_cli.pipeline.localize import run_localize
from bsmap_cli.pipeline.runs import run_map, run_slam
from bsmap_cli.pipeline.two_maps import merge_maps, place_map
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.simulator.simulation import Simulation, simulate

SCENE, LIDAR, STEP_M, SCANS = "shapes", "lms200", 0.2, 40
# small submaps and a graph that trusts nothing: loops are searched for at once
SEARCHING = ("submaps.keyframes=4", "loops.deviations=1000", "loops.retry=0", "loops.max_reach=20")
FADING = ("visibility.method=fade", "final_map.rebuild=false")


@dataclass(frozen=True, slots=True)
class WarmUp:
    """How many kernels there are, how many variants were compiled now, and where they are kept."""

    kernels: int
    compiled: int
    folder: Path


def warm_up() -> WarmUp:
    """Compile what is not compiled yet for this machine and this state of the sources."""
    for rehearsal in _rehearsals():
        rehearsal()
    kernels = list(compiled_functions())
    folders = [kernel.stats.cache_path for kernel in kernels]
    return WarmUp(len(kernels), freshly_compiled(), Path(os.path.commonpath(folders)))


def freshly_compiled() -> int:
    """How many variants of kernels this process has compiled, and not found on the disk."""
    return sum(sum(kernel.stats.cache_misses.values()) for kernel in compiled_functions())


def compiled_functions() -> Iterator[Any]:
    """The dispatchers of numba in the modules that are loaded, apart from parts of others."""
    seen = set()
    for name, module in sorted(sys.modules.items()):
        if name.split(".")[0] != "bsmap_cli":
            continue
        for value in vars(module).values():
            if hasattr(value, "py_func") and hasattr(value, "stats") and id(value) not in seen:
                seen.add(id(value))
                yield value


def _rehearsals() -> Iterator[Callable[[], object]]:
    """Short runs that together call every kernel as real runs do."""
    made = simulate(SCENE, lidar=LIDAR, step_m=STEP_M, sweep=True)
    default, paper = load_settings(), load_settings("paper")
    searching = load_settings(overrides=SEARCHING)
    every_level = replace(default.final_map, all_levels=True)
    yield lambda: run_slam(_Rehearsed(made), replace(searching, final_map=every_level))
    yield lambda: run_slam(_Rehearsed(made), load_settings(overrides=FADING))
    yield lambda: run_slam(_Rehearsed(made), paper)
    yield lambda: run_map(_Rehearsed(made), made.truth, default)
    yield lambda: run_map(_Rehearsed(made), "odom", paper)
    known: MapDocument = run_map(_Rehearsed(made), made.truth, default).document
    yield lambda: run_localize(_Rehearsed(made), known, default)
    yield lambda: run_slam(_Rehearsed(made), default, old=known)
    yield lambda: _asked(MapQuery(known.finest))
    yield lambda: merge_maps(known, known, place_map(known, known, default), default)


def _asked(query: MapQuery) -> None:
    query.nearest(np.zeros((1, 2)))
    query.rays(np.zeros((1, 2)), np.zeros(1))


class _Rehearsed:
    """The first scans of a simulation as a log."""

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
