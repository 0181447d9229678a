"""`bsmap diff`: what changed between two maps of one place."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

from bsmap_cli.cli.options import Json, SettingsFlags, TalkFlags, option
from bsmap_cli.cli.placing import At, FirstMap, SecondMap, placed, read_two
from bsmap_cli.cli.report import print_json, print_rows, print_table

if TYPE_CHECKING:
    from bsmap_cli.evaluation.map_difference import MapDifference, Stretch

LISTED = 20  # stretches, the longest ones


def run(
    *,
    talk: TalkFlags,
    a: FirstMap,
    b: SecondMap,
    at: At = None,
    tolerance: Annotated[
        float | None,
        option(
            "--tolerance",
            metavar="M",
            min=1e-6,
            help="Curves this near are the same; by default the wider of both knot steps.",
        ),
    ] = None,
    settings: SettingsFlags,
    json: Json = False,
) -> None:
    """Show what changed from map A to map B.

    B is placed in the frame of A: searched for in the whole of it and refined, or with --at
    looked for near a pose given by hand. Added is a stretch of B with no curve of A within the
    tolerance that runs the same way. A stretch of A with no such curve of B is removed where B
    saw what is behind it, and else unseen: hidden, out of its way, or at the rim of what it
    shows. B's path and curves tell; a map without a path tells nothing. The rest of A is common,
    and RMS is how far B runs from it. Stretches shorter than three tolerances are noise and count
    as common.

    All coordinates are in the frame of A. Where nothing is found in common, or more than one
    place fits, the exit code is 1.

    \b
    Example:
      bsmap diff old.bsm map.bsm
      bsmap diff old.bsm map.bsm --at 0,0,0 --json
    """
    from bsmap_cli.pipeline.two_maps import compare_maps

    voice = talk.talk()
    first, second = read_two(a, b)
    placement = placed(first, second, at, settings.settings(), voice)
    if not len(second.path):
        voice.note("B has no path: what was removed cannot be told from what B did not see")
    difference = compare_maps(first, second, placement, tolerance_m=tolerance)
    if json:
        print_json(difference.as_json())
        return
    print_rows(_rows(difference), voice)
    if difference.segments:
        header = ("change", "length", "from", "to")
        print_table(header, map(_cells, difference.segments[:LISTED]), voice)
    more = len(difference.segments) - LISTED
    if more > 0:
        voice.note(f"{more} shorter stretches are listed with --json")


def _rows(difference: MapDifference) -> list[tuple[str, str]]:
    pose = difference.pose_a_b
    return [
        ("B in A", f"{pose.x:z.3f}, {pose.y:z.3f} m, {math.degrees(pose.theta):z.2f} degrees"),
        ("common", f"{difference.common_m:.1f} m of wall, RMS {1e3 * difference.rms_m:.1f} mm"),
        ("added", f"{difference.added_m:.1f} m"),
        ("removed", f"{difference.removed_m:.1f} m"),
        ("unseen", f"{difference.unseen_m:.1f} m of A, where B did not look"),
    ]


def _cells(stretch: Stretch) -> tuple[str, str, str, str]:
    begin, end = (f"{x:.2f}, {y:.2f}" for x, y in stretch.points[[0, -1]])
    return stretch.change, f"{stretch.length_m:.2f} m", begin, end
