"""What `diff` and `merge` have in common: two maps in, and where the second lies in the first."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

import typer

from bsmap_cli.cli.inputs import STDIN, read_map_file
from bsmap_cli.cli.options import numbers, option
from bsmap_cli.cli.talk import Talk
from bsmap_cli.errors import UsageError

if TYPE_CHECKING:
    from bsmap_cli.config import Settings
    from bsmap_cli.geometry.se2 import SE2
    from bsmap_cli.mapping.map_document import MapDocument
    from bsmap_cli.slam.map_placing import Placement

FirstMap = Annotated[str, typer.Argument(metavar="A", help="A map; `-`: standard input.")]
SecondMap = Annotated[str, typer.Argument(metavar="B", help="Another map; `-`: standard input.")]
At = Annotated[
    str | None,
    option(
        "--at",
        metavar="X,Y,YAW_DEG",
        help="About where the origin of B lies in A, metres and degrees; within 2 m and 20 "
        "degrees it is refined. Without: the whole of A is searched.",
    ),
]


def read_two(a: str, b: str) -> tuple[MapDocument, MapDocument]:
    """Both maps.

    Raises
    ------
    UsageError : both are to come from standard input.
    """
    if STDIN == a == b:
        raise UsageError("only one of the maps can come from standard input: name the other")
    return read_map_file(a)[0], read_map_file(b)[0]


def placed(
    a: MapDocument, b: MapDocument, at: str | None, settings: Settings, talk: Talk
) -> Placement:
    """Where B lies in A; told on standard error."""
    from bsmap_cli.pipeline.two_maps import place_map

    placement = place_map(a, b, settings, _pose(at))
    if not placement.refined:
        talk.warn("hardly anything overlaps there: --at is taken as it was given")
    elif placement.aside_m > placement.overlap_m:
        talk.warn(
            f"{placement.aside_m:.1f} m of B's curves run beside those of A: the place is wrong, "
            "or one of the maps is bent; a log of B is fitted to A by `bsmap slam --map`"
        )
    pose = placement.pose_a_b
    talk.note(
        f"B lies in A at {pose.x:z.3f},{pose.y:z.3f},{math.degrees(pose.theta):z.3f}; "
        f"{placement.overlap_m:.1f} m of its curves lie on those of A"
    )
    return placement


def _pose(at: str | None) -> SE2 | None:
    from bsmap_cli.geometry.se2 import SE2

    if at is None:
        return None
    x, y, yaw_deg = numbers("--at", at, "1,2,90")
    return SE2.from_array((x, y, math.radians(yaw_deg)))
