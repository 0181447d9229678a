"""What each command costs on a map of ten million control points.

python benchmarks/large_map.py [--points 10000000] [--only query,svg] [--keep FOLDER] [--json FILE]

The map is a small one laid side by side as often as that takes. Each command has a process of its
own: seconds until it is done, processor seconds, most memory, and the size of what it wrote.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bsmap_cli.config import load_settings
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.mapping.map_document import MapDocument, MapLevel
from bsmap_cli.mapping.map_file import write_map
from bsmap_cli.pipeline import run_slam

LOG = Path(__file__).parent.parent / "sample_logs" / "loop.csv.gz"
EXPORTS = ("svg", "geojson", "csv", "json", "yaml", "mcap", "dxf", "ply", "png")
QUESTIONS = 1000
GAP_M = 1.0  # between two copies


def small_map() -> MapDocument:
    """The map of a sample log, with its path."""
    with open_log([LOG], ReadOptions()) as reader:
        return run_slam(reader, load_settings()).document


def tiled(document: MapDocument, points: int) -> MapDocument:
    """Copies of the finest level in a square, until there are so many control points."""
    level = document.finest
    copies = math.ceil(points / len(level.control_points))
    side = math.ceil(math.sqrt(copies))
    low, high = level.control_points.min(axis=0), level.control_points.max(axis=0)
    pitch = high - low + GAP_M
    places = np.array([divmod(copy, side) for copy in range(copies)]) * pitch
    shifts = np.repeat(places, len(level.control_points), axis=0)
    moved = np.tile(level.control_points, (copies, 1)) + shifts
    count = len(level) * copies
    repeated = {
        name: np.tile(getattr(level, name), copies)
        for name in MapLevel.__dataclass_fields__
        if name not in ("degree", "knot_step_m", "curve_ids", "control_points")
    }
    large = replace(
        level,
        curve_ids=np.arange(1, count + 1, dtype=np.uint32),
        control_points=moved.astype(np.float32),
        **repeated,
    )
    return replace(document, levels=(large,))


def questions(document: MapDocument, angles: bool) -> str:
    """Rows of CSV: points all over the map, with directions for rays."""
    random = np.random.default_rng(1)
    level = document.finest
    low, high = level.control_points.min(axis=0), level.control_points.max(axis=0)
    rows = random.uniform(low, high, (QUESTIONS, 2))
    if angles:
        rows = np.column_stack((rows, random.uniform(-180.0, 180.0, QUESTIONS)))
    return "".join(",".join(f"{value:.6f}" for value in row) + "\n" for row in rows)


def commands(
    made: Path, folder: Path, document: MapDocument
) -> Iterator[tuple[str, list[str], str]]:
    """Name, arguments and standard input of everything that is asked of a map."""
    for name in ("stats", "stats --json"):
        yield name, ["stats", str(made), *name.split()[1:]], ""
    for kind in ("nearest", "ray", "distance"):
        asked = questions(document, kind == "ray")
        yield f"query {kind}, one", ["query", str(made), kind, asked.splitlines()[0]], ""
        yield f"query {kind}, {QUESTIONS}", ["query", str(made), kind], asked
    for suffix in EXPORTS:
        yield f"export {suffix}", ["export", str(made), "-o", str(folder / f"m.{suffix}")], ""
    yield "plot png", ["plot", str(made), "-o", str(folder / "plot.png")], ""
    yield "view html", ["view", str(made), "-o", str(folder / "view.html")], ""
    yield "diff", ["diff", str(made), str(made), "--at", "0,0,0"], ""


def measured(arguments: list[str], asked: str, limit_s: float) -> dict[str, Any]:
    """Run one command to its end, or until the limit."""
    began = time.perf_counter()
    with tempfile.TemporaryFile() as source:
        source.write(asked.encode())
        source.seek(0)
        process = subprocess.Popen(
            [sys.executable, "-m", "bsmap_cli", *arguments],
            stdin=source,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
        while time.perf_counter() - began < limit_s:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            time.sleep(0.02)
        else:
            process.kill()
            _, status, usage = os.wait4(process.pid, 0)
    said = process.stderr.read().decode() if process.stderr else ""
    return {
        "seconds": time.perf_counter() - began,
        "processor_seconds": usage.ru_utime + usage.ru_stime,
        "peak_memory_mb": usage.ru_maxrss / 1024.0,
        "status": os.waitstatus_to_exitcode(status),
        "said": said.strip().splitlines()[-1:] if said else [],
    }


def main() -> None:
    """Make the map, then print a row for each command."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--points", type=int, default=10_000_000)
    parser.add_argument("--only", default="", help="commands whose names hold one of these, by ,")
    parser.add_argument("--keep", type=Path, help="work here, and leave what was written")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds for one command")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures")
    arguments = parser.parse_args()
    wanted = [part for part in arguments.only.split(",") if part]
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = arguments.keep or Path(name)
        folder.mkdir(exist_ok=True)
        made = folder / "large.bsm"
        document = tiled(small_map(), arguments.points)
        with made.open("wb") as stream:
            write_map(stream, document)
        print(f"{len(document.finest.control_points)} control points, {made.stat().st_size} bytes")
        print(f"{'':<22}{'s':>9}{'cpu s':>9}{'peak MB':>9}{'MB out':>9}", flush=True)
        for title, command, asked in commands(made, folder, document):
            if wanted and not any(part in title for part in wanted):
                continue
            out = Path(command[command.index("-o") + 1]) if "-o" in command else None
            figures = measured([*command, *(["-f"] if out else [])], asked, arguments.limit)
            size_mb = out.stat().st_size / 1e6 if out and out.exists() else 0.0
            found[title] = {**figures, "megabytes_out": size_mb}
            numbers = (figures["seconds"], figures["processor_seconds"])
            print(f"{title:<22}" + "".join(f"{value:>9.1f}" for value in numbers), end="")
            print(f"{figures['peak_memory_mb']:>9.0f}{size_mb:>9.1f}", end="")
            failed = f"  exit {figures['status']} {figures['said']}" if figures["status"] else ""
            print(failed, flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
