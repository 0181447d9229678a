"""How good `slam` is, in one table: simulated scenes with their truth, and logs of your own.

python benchmarks/accuracy.py                            all scenes, lidars and awkward variants
python benchmarks/accuracy.py --only 'loop/*' --pictures out/
python benchmarks/accuracy.py FOLDER_OR_LOG... --no-scenes

A log is judged by what lies beside it: NAME.relations or NAME.truth.tum. --set changes settings.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable, Iterator
from fnmatch import fnmatch
from functools import partial
from pathlib import Path

from cases import LIDARS, LONG, SCENES, Case, logs_in, recorded_case, simulated_cases
from judging import Judged, judge

from bsmap_cli.config import load_settings

COLUMNS = (  # heading, its row in `Judged`, width, form, factor
    ("scans", "scans", 7, "d", 1),
    ("way m", "way_m", 7, ".0f", 1),
    ("ATE cm", "ate_m", 8, ".2f", 100),
    ("max cm", "max_m", 8, ".2f", 100),
    ("end cm", "end_m", 8, ".2f", 100),
    ("end deg", "end_deg", 8, ".2f", 1),
    ("rel cm", "relation_m", 8, ".2f", 100),
    ("+- cm", "relation_std_m", 7, ".2f", 100),
    ("rel deg", "relation_deg", 8, ".3f", 1),
    ("wall cm", "wall_m", 8, ".2f", 100),
    ("lost", "lost", 5, "d", 1),
    ("degen %", "degenerate", 8, ".1f", 100),
    ("loops", "loops", 6, "d", 1),
    ("wrong", "loops_rejected", 6, "d", 1),
    ("curves", "curves", 7, "d", 1),
    ("points", "control_points", 7, "d", 1),
    ("redund.", "redundancy", 8, ".3f", 1),
    ("s", "seconds", 7, ".1f", 1),
)


def heading() -> str:
    """The line above the table."""
    return f"{'case':<28}" + "".join(f"{column[0]:>{column[2]}}" for column in COLUMNS)


def line(row: Judged) -> str:
    """One line of the table."""
    cells = []
    for _, name, width, form, factor in COLUMNS:
        value = getattr(row, name)
        cells.append(f"{'-' if value is None else format(factor * value, form):>{width}}")
    return f"{row.name:<28}" + "".join(cells)


def chosen_cases(arguments: argparse.Namespace) -> Iterator[Case]:
    """The logs first, then the scenes; made one at a time, as a case may be large."""
    makers: list[Callable[[], Case]] = []
    for path in logs_in(arguments.logs):
        makers += [partial(recorded_case, path, odometry=odometry) for odometry in (True, False)]
    if not arguments.no_scenes:
        scenes = SCENES + (LONG if arguments.long else ())
        makers += simulated_cases(scenes, LIDARS)
    for make in makers:
        case = make()
        if not arguments.only or any(fnmatch(case.name, pattern) for pattern in arguments.only):
            yield case


def main() -> None:
    """Print the table, a line as soon as it is known."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("logs", nargs="*", type=Path, help="logs, or folders of them")
    parser.add_argument("--only", action="append", help="cases by pattern, such as 'loop/*/none'")
    parser.add_argument("--long", action="store_true", help="also the 2 km of the campus")
    parser.add_argument("--no-scenes", action="store_true", help="only the logs")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="draw each map")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows")
    arguments = parser.parse_args()
    settings = load_settings(overrides=arguments.set)
    rows = []
    print(heading(), flush=True)
    for case in chosen_cases(arguments):
        row = judge(case, settings, arguments.pictures)
        rows.append(row.as_json())
        print(line(row), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
