"""The paper's experiments: tables on stdout, pictures after its Figs. 3 to 6 in a folder.

python benchmarks/paper.py OUT                     everything, some minutes
python benchmarks/paper.py OUT --quick             a third of each drive, two ladders
python benchmarks/paper.py OUT --parts missions    only that
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

from paper_basins import Basin, basins
from paper_figures import draw_errors, draw_missions, draw_shapes
from paper_missions import LADDERS, MISSIONS, MissionRun, compile_kernels, mission_runs
from paper_studies import ParameterRun, ShapesRun, parameter_runs, shapes_runs

PARTS = ("missions", "parameters", "shapes", "basins")
QUICK_SHARE = 0.34


def main() -> None:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, help="folder for the pictures")
    parser.add_argument("--quick", action="store_true", help="a third of each drive, two ladders")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--missions", nargs="+", choices=MISSIONS, default=MISSIONS)
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    share = QUICK_SHARE if asked.quick else 1.0
    ladders = ("0.1", "ladder") if asked.quick else tuple(LADDERS)
    compile_kernels()
    if "missions" in asked.parts:
        runs = print_missions(mission_runs(tuple(asked.missions), ladders, share))
        draw_missions(runs, asked.out)
        draw_errors(runs, asked.out)
    if "parameters" in asked.parts:
        print_parameters(parameter_runs(every=2 if asked.quick else 1))
    if "shapes" in asked.parts:
        shown = print_shapes(shapes_runs(share))
        draw_shapes(shown[-1], asked.out)
    if "basins" in asked.parts and not asked.quick:
        print_basins(basins())


def print_missions(runs: Iterable[MissionRun]) -> list[MissionRun]:
    """One row a run, as they come."""
    _head(
        "mission", "profile", "noise", "Delta", "final", "of the path", "rotation", "greatest",
        "curves", "control points", "bytes", "map update", "SLAM",
    )  # fmt: skip
    done = []
    for run in runs:
        metres, path_m = float(run.metres[-1]), run.path_m
        _row(
            run.mission,
            run.profile,
            f"{100 * run.noise_m:g} cm",
            run.ladder,
            _length(metres),
            f"{100 * metres / path_m:.3f} %" if path_m > 0.1 else "",
            f"{float(run.degrees[-1]):.3f}°",
            f"{_length(float(run.metres.max()))}, {float(run.degrees.max()):.2f}°",
            len(run.document.finest),
            run.control_points,
            run.bytes,
            f"{run.update_ms:.2f} ms",
            f"{run.slam_ms:.2f} ms",
        )
        done.append(run)
    return done


def print_parameters(runs: Iterable[ParameterRun]) -> None:
    """One row a value."""
    _head(
        "profile", "parameter", "value", "curves", "control points", "bytes", "drawn",
        "ghosts", "rms", "p95", "of what stands", "of the new box",
    )  # fmt: skip
    for run in runs:
        _row(
            run.profile,
            run.parameter,
            run.value.strip("[]"),
            run.curves,
            run.control_points,
            run.bytes,
            f"{run.drawn_m:.1f} m",
            f"{run.ghost_m:.2f} m",
            _length(run.rms_m),
            _length(run.p95_m),
            f"{100 * run.standing_share:.0f} %",
            f"{100 * run.new_share:.0f} %",
        )


def print_shapes(runs: Iterable[ShapesRun]) -> list[ShapesRun]:
    """One row a map."""
    _head(
        "profile", "noise", "made by", "curves", "control points", "bytes", "compressed",
        "5 cm grid", "ratio", "as PNG", "ratio", "compressed to PNG", "map update",
    )  # fmt: skip
    done = []
    for run in runs:
        s = run.statistics
        png = s.grid_5cm_png_bytes
        _row(
            run.profile,
            f"{100 * run.noise_m:g} cm",
            run.verb,
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
        done.append(run)
    return done


def print_basins(found: Iterable[Basin]) -> None:
    """One row a place, distance and method."""
    _head("scene", "lidar", "off by", "method", "found", "time")
    for basin in found:
        _row(
            basin.scene,
            basin.lidar,
            f"{basin.off_m:g} m, {basin.off_deg:g}°",
            basin.method,
            f"{100 * basin.found:.0f} %",
            f"{basin.ms:.1f} ms",
        )


def _length(metres: float) -> str:
    return f"{1e3 * metres:.2f} mm" if metres < 1.0 else f"{metres:.1f} m"


def _head(*names: str) -> None:
    print()
    _row(*names)
    _row(*("---" for _ in names))


def _row(*cells: object) -> None:
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


if __name__ == "__main__":
    main()
