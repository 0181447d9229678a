"""What each stage of `slam` buys: one of them changed or switched off at a time, by settings.

python benchmarks/ablation.py FOLDER_OR_LOG... [--write docs/slam.md]

A log is judged by what lies beside it: NAME.relations or NAME.truth.tum. Two simulated scenes,
judged by their truth, come with them.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

from cases import Case, logs_in, recorded_case, simulated_case
from judging import Judged, judge
from pages import markdown, write_table

from bsmap_cli.config import load_settings

NO_ODOMETRY = "odometry left out"
CHANGES: dict[str, tuple[str, ...]] = {
    "as built": (),
    NO_ODOMETRY: (),
    "no prior from odometry": (
        "prediction.odometry_sigma=1e3",
        "prediction.odometry_sigma_deg=180",
    ),
    "one level, 0.1 m": ("ladder=[0.1]",),
    "one level, 0.2 m": ("ladder=[0.2]",),
    "no shortcut to the finest level": ("registration.shortcut=2",),
    "no test for unobserved directions": ("registration.degenerate=0",),
    "curves to curves on the coarsest level": ("registration.method=joint_first",),
    "no thinning": ("fitting.thinning=0",),
    "merging by Table I": ("merging.method=table",),
    "every scan a keyframe": ("keyframes.distance=0",),
    "no recovery": ("recovery.search_below=0", "recovery.lost_below=0"),
    "no loop closure": ("loops.enabled=false",),
    "no final rounds": ("final_map.rounds=0",),
    "the map as tracking built it": ("final_map.rebuild=false",),
    "what moves stays in the map": ("visibility.method=off",),
}
SIMULATED = (("loop", "lms200"), ("hallway", "lms200"))


def main() -> None:
    """Print the table, a line as soon as it is known, and put it on a page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("logs", nargs="*", type=Path, help="logs, or folders of them")
    parser.add_argument("--write", type=Path, metavar="PAGE", help="also put it on this page")
    arguments = parser.parse_args()
    with_wheels, without = (cases(arguments.logs, odometry=on) for on in (True, False))
    names = [case.name.removesuffix("/odom") for case in with_wheels]
    judge(with_wheels[-1], load_settings())  # what is compiled now does not count below
    heading = ("changed", *names, "redundancy", "control points", "seconds")
    table = markdown(heading, rows(with_wheels, without))
    if arguments.write:
        write_table(arguments.write, "ablation", table)


def cases(logs: list[Path], *, odometry: bool) -> list[Case]:
    """The columns."""
    found = [recorded_case(path, odometry=odometry) for path in logs_in(logs)]
    return found + [simulated_case(scene, lidar, odometry=odometry) for scene, lidar in SIMULATED]


def rows(with_wheels: list[Case], without: list[Case]) -> Iterator[tuple[object, ...]]:
    """A line for each change: the error on each log, then sums over all."""
    for name, change in CHANGES.items():
        settings = load_settings(overrides=change)
        judged = [judge(c, settings) for c in (without if name == NO_ODOMETRY else with_wheels)]
        redundancy = sum(row.redundancy for row in judged) / len(judged)
        points = sum(row.control_points for row in judged)
        seconds = sum(row.seconds for row in judged)
        yield name, *map(error, judged), f"{redundancy:.3f}", points, f"{seconds:.0f}"


def error(row: Judged) -> str:
    """Mean error of the relations, or ATE [cm], and how often the map was lost."""
    text = f"{100 * row.ate_m:.1f}" if row.ate_m is not None else ""
    if row.relation_m is not None and row.relation_deg is not None:
        text = f"{100 * row.relation_m:.2f}, {row.relation_deg:.2f}°"
    return text + (f" (lost {row.lost} x)" if row.lost else "")


if __name__ == "__main__":
    main()
