"""What each command costs on a map of ten million control points.

python benchmarks/large_map.py [--points 10000000] [--only query,svg] [--keep FOLDER] [--json FILE]

The map is a small one laid side by side as often as that takes. Each command has a process of its
own: seconds until it is done, processor seconds, most memory, and the size of what it wrote, as
rows of the table in docs/performance.md. What takes more than --limit or --memory is ended.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from multiprocessing import get_context
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
GRIDS = ("yaml", "png")
CELL_M = 0.2  # of their cells, where 5 cm are refused
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


def make(folder: Path, points: int) -> tuple[int, list[float], list[float]]:
    """Write the small map and the large one; control points of the large one, and its corners."""
    small = small_map()
    document = tiled(small, points)
    for made, name in ((small, "small"), (document, "large")):
        with (folder / f"{name}.bsm").open("wb") as stream:
            write_map(stream, made)
    control = document.finest.control_points
    return len(control), control.min(axis=0).tolist(), control.max(axis=0).tolist()


def questions(low: list[float], high: list[float], angles: bool) -> str:
    """Rows of CSV: points all over the map, with directions for rays."""
    random = np.random.default_rng(1)
    rows = random.uniform(low, high, (QUESTIONS, 2))
    if angles:
        rows = np.column_stack((rows, random.uniform(-180.0, 180.0, QUESTIONS)))
    return "".join(",".join(f"{value:.6f}" for value in row) + "\n" for row in rows)


def commands(
    made: Path, folder: Path, low: list[float], high: list[float]
) -> Iterator[tuple[str, list[str], str]]:
    """Name, arguments and standard input of everything that is asked of a map."""
    yield "stats", ["stats", str(made)], ""
    for kind in ("nearest", "ray", "distance"):
        asked = questions(low, high, kind == "ray")
        yield f"query {kind}, {QUESTIONS}", ["query", str(made), kind], asked
    yield "query nearest, one", ["query", str(made), "nearest", "1,1"], ""
    for suffix in EXPORTS:
        yield (
            f"export {suffix}",
            ["export", str(made), "-o", str(folder / f"{suffix}.{suffix}")],
            "",
        )
    for suffix in GRIDS:
        wide = ["--resolution", f"{CELL_M:g}", "-o", str(folder / f"{suffix}-wide.{suffix}")]
        yield f"export {suffix}, {CELL_M:g} m", ["export", str(made), *wide], ""
    yield "plot png", ["plot", str(made), "-o", str(folder / "plot.png")], ""
    yield "view html", ["view", str(made), "-o", str(folder / "view.html")], ""
    itself = [str(made), str(made), "--at", "0,0,0"]
    yield "diff with itself", ["diff", *itself], ""
    yield "merge with itself", ["merge", *itself, "-o", str(folder / "merged.bsm")], ""


def measured(
    arguments: list[str], asked: str, limit_s: float = 600.0, limit_mb: float = math.inf
) -> dict[str, Any]:
    """Run one command to its end, or until a limit."""
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
        allowed = (math.ceil(limit_s), math.ceil(limit_s))
        resource.prlimit(process.pid, resource.RLIMIT_CPU, allowed)
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            if held_mb(process.pid) > limit_mb:
                process.kill()
            time.sleep(0.02)
    said = process.stderr.read().decode() if process.stderr else ""
    return {
        "seconds": time.perf_counter() - began,
        "processor_seconds": usage.ru_utime + usage.ru_stime,
        "peak_memory_mb": usage.ru_maxrss / 1024.0,
        "status": os.waitstatus_to_exitcode(status),
        "said": said.strip().splitlines()[-1:] if said else [],
    }


def held_mb(process: int) -> float:
    """Memory that a process holds now; 0 where the system does not tell."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def written(out: Path | None) -> list[Path]:
    """What was written under the name, its image beside a YAML included."""
    return sorted(out.parent.glob(f"{out.stem}.*")) if out else []


def row(title: str, figures: dict[str, Any]) -> str:
    """A row of the table: what failed says why, what was ended says so."""
    seconds = (f"{figures[key]:.1f}" for key in ("seconds", "processor_seconds"))
    size_mb = figures["megabytes_out"]
    name = title
    if figures["status"] < 0:
        name += ": ended, not done"
    elif figures["status"]:
        name += f": refused ({' '.join(figures['said']).removeprefix('error: ')})"
    memory, out = f"{figures['peak_memory_mb']:.0f}", f"{size_mb:.1f}" if size_mb else ""
    return f"| {' | '.join((name, *seconds, memory, out))} |"


def main() -> None:
    """Make the map, then print a row for each command."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--points", type=int, default=10_000_000)
    parser.add_argument("--only", default="", help="commands whose names hold one of these, by ,")
    parser.add_argument("--keep", type=Path, help="work here, and leave what was written")
    parser.add_argument("--limit", type=float, default=600.0, help="processor seconds for each")
    parser.add_argument("--memory", type=float, default=8000.0, help="MB for each")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the figures")
    arguments = parser.parse_args()
    wanted = [part for part in arguments.only.split(",") if part]
    found: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or Path(temporary)
        folder.mkdir(exist_ok=True)
        made = folder / "large.bsm"
        # in a process of its own: a child counts the memory of its parent as its own
        with get_context("spawn").Pool(1) as pool:
            count, low, high = pool.apply(make, (folder, arguments.points))
        for _, command, asked in commands(folder / "small.bsm", folder, low, high):
            measured([*command, *(["-f"] if "-o" in command else [])], asked)  # compiles
        print(f"{count} control points, {made.stat().st_size} bytes")
        print("\n| | s | cpu s | peak MB | MB out |\n|---|---|---|---|---|", flush=True)
        for title, command, asked in commands(made, folder, low, high):
            if wanted and not any(part in title for part in wanted):
                continue
            out = Path(command[command.index("-o") + 1]) if "-o" in command else None
            for old in written(out):
                old.unlink()
            figures = measured(command, asked, arguments.limit, arguments.memory)
            size_mb = sum(path.stat().st_size for path in written(out)) / 1e6
            found[title] = {**figures, "megabytes_out": size_mb}
            print(row(title, found[title]), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(found, indent=1) + "\n")


if __name__ == "__main__":
    main()
