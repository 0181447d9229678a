"""Options of single commands, and those that all commands have."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import typer

from bsmap_cli.cli.talk import ColorMode, Talk
from bsmap_cli.errors import UsageError

READING, SETTINGS, SENSOR, TALKING = "Reading the log", "Settings", "Sensor", "Messages"


def option(*names: str, metavar: str | None = None, panel: str | None = None, **more: Any) -> Any:
    """One option of the registry."""
    return typer.Option(*names, metavar=metavar, rich_help_panel=panel, **more)


Logs = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="LOG...",
        help="Log files, the parts of one run in order, or a folder; `-` or nothing where "
        "standard input is a pipe: standard input.",
    ),
]
MapIn = Annotated[
    str | None,
    typer.Argument(
        metavar="MAP",
        help="A map file; `-` or nothing where standard input is a pipe: standard input.",
    ),
]
Force = Annotated[bool, option("--force", "-f", help="Replace output files that exist.")]
Strict = Annotated[
    bool,
    option("--strict", help="Fail (exit 1) and write nothing where something was lost."),
]
Json = Annotated[bool, option("--json", help="Print the report as one JSON document.")]
TrajectoryOut = Annotated[
    str | None,
    option(
        "--traj",
        metavar="FILE",
        help="Also write the trajectory, a line a scan: TUM (stamp x y z qx qy qz qw), or "
        ".csv, .json, .kitti by extension.",
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class TalkFlags:
    """How much is said on standard error."""

    quiet: Annotated[
        bool,
        option("--quiet", "-q", panel=TALKING, help="Say only what went wrong or was lost."),
    ] = False
    verbose: Annotated[
        int,
        option(
            "--verbose",
            "-v",
            panel=TALKING,
            count=True,
            show_default=False,
            help="Say more; -vv adds debug lines and tracebacks.",
        ),
    ] = 0
    color: Annotated[
        ColorMode,
        option(
            "--color",
            metavar="auto|always|never",
            panel=TALKING,
            help="Color the messages; auto: on a terminal unless NO_COLOR is set.",
        ),
    ] = "auto"

    def talk(self) -> Talk:
        """The voice these flags ask for."""
        return Talk(level=-1 if self.quiet and not self.verbose else self.verbose, color=self.color)


def numbers(name: str, text: str, example: str) -> list[float]:
    """As many finite numbers, separated by commas, as the example has; UsageError otherwise."""
    count = example.count(",") + 1
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(value) for value in values):
        raise UsageError(f"{name} {text}: give {count} numbers with commas, such as {example}")
    return values


def box(text: str | None) -> tuple[float, float, float, float] | None:
    """The box x0, y0, x1, y1 [m] of --clip; UsageError where it is none."""
    if text is None:
        return None
    x0, y0, x1, y1 = numbers("--clip", text, "0,0,4,3")
    if x0 >= x1 or y0 >= y1:
        raise UsageError(f"--clip {text}: give the lower left corner, then the upper right one")
    return x0, y0, x1, y1
