"""The paper's experiments: tables on stdout, pictures after its Figs. 3 to 6 in a folder.

python benchmarks/paper.py OUT                     everything, some minutes
python benchmarks/paper.py OUT --quick             a third of each drive, two ladders
python benchmarks/paper.py OUT --parts shapes      only that
python benchmarks/paper.py docs/images --write docs/paper.md    and refresh the page
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Iterator
from pathlib import Path

from pages import length, markdown, write_table
from paper_basins import Basin, basins
from paper_figures import draw_errors, draw_missions, draw_shapes
from paper_missions import LADDERS, MISSIONS, MissionRun, compile_kernels, mission_runs
from paper_studies import ParameterRun, ShapesRun, parameter_runs, shapes_runs

PARTS = (*MISSIONS, "parameters", "shapes", "basins")
QUICK_SHARE = 0.34
Rows = Iterator[tuple[object, ...]]
Tables = Iterator[tuple[str, str]]


def main() -> None:
    """Run what is asked for, and put each table on the page as soon as it is known."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, help="folder for the pictures")
    parser.add_argument("--quick", action="store_true", help="a third of each drive, two ladders")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--write", type=Path, metavar="PAGE", help="also put the tables on a page")
    asked = parser.parse_args()
    if asked.quick and asked.write:
        parser.error("--quick is for a first look: its figures belong on no page")
    asked.out.mkdir(parents=True, exist_ok=True)
    compile_kernels()
    for name, table in tables(asked.parts, asked.out, quick=asked.quick):
        if asked.write:
            write_table(asked.write, name, table)


def tables(parts: Iterable[str], out: Path, *, quick: bool) -> Tables:
    """Name and text of each table, after its pictures are drawn."""
    share = QUICK_SHARE if quick else 1.0
    ladders = ("0.1", "ladder") if quick else tuple(LADDERS)
    for mission in (part for part in parts if part in MISSIONS):
        drives: list[MissionRun] = []
        rows = mission_rows(mission_runs((mission,), ladders, share), drives)
        yield mission, markdown(MISSION_NAMES, rows)
        draw_missions(drives, out)
        draw_errors(drives, out)
    if "parameters" in parts:
        every = 2 if quick else 1
        yield "parameters", markdown(PARAMETER_NAMES, parameter_rows(parameter_runs(every=every)))
    if "shapes" in parts:
        maps: list[ShapesRun] = []
        yield "shapes", markdown(SHAPES_NAMES, shapes_rows(shapes_runs(share), maps))
        draw_shapes(maps[-1], out)
    if "basins" in parts and not quick:
        yield "basins", markdown(BASIN_NAMES, basin_rows(basins()))


MISSION_NAMES = (
    *("profile", "noise", "Delta", "last pose", "of the path", "rotation", "greatest"),
    *("curves", "control points", "bytes", "map update", "SLAM"),
)


def mission_rows(runs: Iterable[MissionRun], drives: list[MissionRun]) -> Rows:
    """One row a run, which also goes into `drives`."""
    for run in runs:
        drives.append(run)
        metres, path_m = float(run.metres[-1]), run.path_m
        yield (
            f"`{run.profile}`",
            f"{100 * run.noise_m:g} cm",
            run.ladder,
            length(metres),
            f"{100 * metres / path_m:.3f} %" if path_m > 0.1 else "",
            f"{float(run.degrees[-1]):.2f}°",
            f"{length(float(run.metres.max()))}, {float(run.degrees.max()):.2f}°",
            len(run.document.finest),
            run.control_points,
            run.bytes,
            f"{run.update_ms:.2f} ms",
            f"{run.slam_ms:.2f} ms",
        )


PARAMETER_NAMES = (
    *("profile", "parameter", "value", "curves", "control points", "bytes", "drawn", "ghosts"),
    *("rms", "p95", "of what stands", "of the new box"),
)


def parameter_rows(runs: Iterable[ParameterRun]) -> Rows:
    """One row a value."""
    for run in runs:
        yield (
            f"`{run.profile}`",
            run.parameter,
            run.value.strip("[]"),
            run.curves,
            run.control_points,
            run.bytes,
            f"{run.drawn_m:.1f} m",
            f"{run.ghost_m:.2f} m",
            length(run.rms_m),
            length(run.p95_m),
            f"{100 * run.standing_share:.0f} %",
            f"{100 * run.new_share:.0f} %",
        )


SHAPES_NAMES = (
    *("profile", "noise", "made by", "curves", "control points", "bytes", "compressed"),
    *("5 cm grid", "ratio", "as PNG", "PNG to bytes", "PNG to compressed", "map update"),
)


def shapes_rows(runs: Iterable[ShapesRun], maps: list[ShapesRun]) -> Rows:
    """One row a map, which also goes into `maps`."""
    for run in runs:
        maps.append(run)
        s = run.statistics
        png = s.grid_5cm_png_bytes
        yield (
            f"`{run.profile}`",
            f"{100 * run.noise_m:g} cm",
            f"`{run.verb}`",
            s.curves,
            s.control_points,
            s.payload_bytes,
            run.compressed_bytes,
            s.grid_5cm_bytes,
            f"{s.ratio_to_grid_5cm:.1f}" if s.ratio_to_grid_5cm else "",
            png or "",
            f"{s.ratio_to_png:.2f}" if s.ratio_to_png else "",
            f"{png / run.compressed_bytes:.2f}" if png else "",
            f"{run.update_ms:.2f} ms",
        )


BASIN_NAMES = ("scene", "lidar", "off by", "method", "found", "time")


def basin_rows(found: Iterable[Basin]) -> Rows:
    """One row a place, distance and method."""
    for basin in found:
        yield (
            f"`{basin.scene}`",
            basin.lidar,
            f"{basin.off_m:g} m, {basin.off_deg:g}°",
            f"`{basin.method}`",
            f"{100 * basin.found:.0f} %",
            f"{basin.ms:.1f} ms",
        )


if __name__ == "__main__":
    main()
