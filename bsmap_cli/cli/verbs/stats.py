"""`bsmap stats`: what a map holds and what it costs."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Annotated

from bsmap_cli.cli.inputs import map_source, read_map_file
from bsmap_cli.cli.options import Json, MapIn, TalkFlags, option
from bsmap_cli.cli.picture import can_show, print_picture
from bsmap_cli.cli.report import print_json, print_rows, print_table, size
from bsmap_cli.cli.talk import is_terminal
from bsmap_cli.errors import UsageError

if TYPE_CHECKING:
    from bsmap_cli.evaluation.map_statistics import MapStatistics

TEXT_LINES = 11  # of the report beside its levels, which stay in view with the picture


def run(
    *,
    talk: TalkFlags,
    map_: MapIn = None,
    picture: Annotated[
        bool | None,
        option(
            "--picture/--no-picture",
            show_default=False,
            help="Draw the map in braille letters, as large as the terminal; by default where "
            "standard output is one.",
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Show what a map holds and its size, beside a grid of the place.

    The payload is what the curves of the finest level take: 16 bytes a curve, 8 a knot vector
    and 9 a control point where they are not compressed. The grid has cells of 5 cm and one byte
    each; its PNG is the same grid as an image. Redundancy tells how much is drawn twice: 1 means
    nothing.

    \b
    Example:
      bsmap stats map.bsm
      bsmap stats map.bsm --json
      bsmap stats map.bsm --picture > map.txt
    """
    from bsmap_cli.evaluation.map_statistics import map_statistics

    if picture and json:
        raise UsageError("--picture does not go with --json: leave one of them out")
    document, sizes = read_map_file(map_source(map_))
    statistics = map_statistics(document, sizes)
    if json:
        print_json(statistics.as_json())
        return
    voice = talk.talk()
    if is_terminal(sys.stdout) and can_show(sys.stdout) if picture is None else picture:
        print_picture(document.chosen_levels(), beside=len(statistics.levels) + TEXT_LINES)
    print_rows(_rows(statistics), voice)
    header = ("knot step", "curves", "control points", "bytes", "length")
    rows = [
        (
            f"{level.knot_step:g} m",
            str(level.curves),
            str(level.control_points),
            str(level.bytes),
            f"{level.length_m:.1f} m",
        )
        for level in statistics.levels
    ]
    print_table(header, rows, voice)


def _rows(statistics: MapStatistics) -> list[tuple[str, str]]:
    per_point, bounds = statistics.bytes_per_control_point, statistics.bounds_m
    per_metre = statistics.payload_bytes / statistics.length_m if statistics.length_m else None
    rows = [
        ("file", size(statistics.file_bytes)),
        ("payload", f"{size(statistics.payload_bytes)}{_of(per_metre, 'B a metre of wall')}"),
        ("path", size(statistics.path_bytes)),
        ("curves", f"{statistics.curves} of degree {statistics.degree}"),
        ("control points", f"{statistics.control_points}{_of(per_point, 'B each')}"),
        ("length", f"{statistics.length_m:.1f} m of wall"),
    ]
    if bounds is None:
        return [*rows, ("extent", "nothing is drawn")]
    return [
        *rows,
        ("extent", _extent(bounds)),
        ("redundancy", f"{statistics.redundancy:.3f}"),
        ("5 cm grid", _grid(statistics.grid_5cm_bytes, statistics.ratio_to_grid_5cm)),
        ("  as PNG", _grid(statistics.grid_5cm_png_bytes, statistics.ratio_to_png)),
    ]


def _of(value: float | None, unit: str) -> str:
    return "" if value is None else f" ({value:.1f} {unit})"


def _extent(bounds_m: tuple[float, float, float, float]) -> str:
    x0, y0, x1, y1 = bounds_m
    return f"{x1 - x0:.1f} x {y1 - y0:.1f} m"


def _grid(grid_bytes: int | None, ratio: float | None) -> str:
    if grid_bytes is None or ratio is None:
        return "too large to draw"
    return f"{size(grid_bytes)}, {ratio:.1f} times the payload"
