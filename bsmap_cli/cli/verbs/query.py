"""`bsmap query`: the nearest wall, what a ray meets, how far it is."""

from __future__ import annotations

import csv
import math
import sys
from collections.abc import Iterable, Iterator
from itertools import islice
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from bsmap_cli.cli.inputs import STDIN, read_map_file, text_input
from bsmap_cli.cli.options import Json, TalkFlags, option
from bsmap_cli.cli.report import print_json, print_text
from bsmap_cli.cli.talk import is_terminal
from bsmap_cli.errors import BsmapError, LogError, MapFileError, UsageError

if TYPE_CHECKING:
    from bsmap_cli.mapping.queries import MapQuery

CONTEXT = {"ignore_unknown_options": True}  # -1,2 is a point
COLUMNS = {
    "nearest": ("x", "y"),
    "ray": ("x", "y", "angle_deg"),
    "distance": ("x", "y"),
}
ANSWERS = {
    "nearest": ("x_m", "y_m", "distance_m", "side", "heading_deg", "curve_id", "tau_m"),
    "ray": ("range_m", "x_m", "y_m", "curve_id"),
    "distance": ("distance_m",),
}
AT_ONCE = 10_000

Row = tuple[float, ...]
Answer = tuple[Any, ...]


def run(
    *,
    talk: TalkFlags,
    map_: Annotated[str, typer.Argument(metavar="MAP", help="The map; `-`: standard input.")],
    kind: Annotated[
        Literal["nearest", "ray", "distance"],
        typer.Argument(metavar="nearest|ray|distance", help="What is asked."),
    ],
    points: Annotated[
        list[str] | None,
        typer.Argument(metavar="POINT...", help="x,y in metres, for rays x,y,angle_deg."),
    ] = None,
    level: Annotated[
        float | None, option("--level", metavar="STEP", help="Ask the level of this knot step [m].")
    ] = None,
    range_max: Annotated[
        float, option("--range-max", metavar="M", min=0.0, help="How far rays reach.")
    ] = math.inf,
    json: Json = False,
) -> None:
    """Ask a map for the nearest wall, what a ray meets, how far it is.

    Points are arguments, or rows of CSV on standard input, with or without a header of the
    columns x, y and angle_deg. Answers are CSV, a row a point, in the same order. A side is `free`
    where the robot saw the curve from, else `behind`; a ray that meets nothing has an empty range.

    \b
    Example:
      bsmap query map.bsm nearest 1.5,2 -0.5,1
      echo 0,0,90 | bsmap query map.bsm ray
    """
    from bsmap_cli.mapping.queries import MapQuery

    if map_ == STDIN and not points:
        raise UsageError("map and points cannot both come from standard input: name one of them")
    document, _ = read_map_file(map_)
    asked = MapQuery(document.chosen_levels(level)[-1])
    if not len(asked):
        raise MapFileError(f"{map_} draws no curve: there is nothing to ask")
    if points:
        batches = [[_numbers(point.split(","), kind, point) for point in points]]
        _answer(asked, kind, batches, range_max, json)
        return
    if is_terminal(sys.stdin):  # each line gets its answer at once
        form = ",".join(COLUMNS[kind])
        talk.talk().note(f"points are read from the terminal: {form} a line, then Ctrl-D")
        by_hand = iter(sys.stdin.readline, "")
        _answer(asked, kind, _batches(by_hand, kind, 1), range_max, json)
        return
    with text_input(STDIN) as lines:
        _answer(asked, kind, _batches(lines, kind, AT_ONCE), range_max, json)


def _answer(
    asked: MapQuery,
    kind: str,
    batches: Iterable[list[Row]],
    range_max_m: float,
    as_json: bool,
) -> None:
    header = ANSWERS[kind]
    if as_json:
        rows = [row for batch in batches for row in _answers(asked, kind, batch, range_max_m)]
        print_json([dict(zip(header, row, strict=True)) for row in rows])
        return
    print_text(",".join(header) + "\n")
    for batch in batches:
        for row in _answers(asked, kind, batch, range_max_m):
            print_text(",".join(_cell(value) for value in row) + "\n")


def _answers(asked: MapQuery, kind: str, batch: list[Row], range_max_m: float) -> Iterator[Answer]:
    import numpy as np

    rows = np.array(batch, float).reshape(len(batch), -1)
    if kind == "ray":
        hits = asked.rays(rows[:, :2], np.radians(rows[:, 2]), range_max_m)
        for range_m, (x, y), curve in zip(
            hits.range_m.tolist(), hits.points.tolist(), hits.curve_id.tolist(), strict=True
        ):
            yield (range_m, x, y, curve) if math.isfinite(range_m) else (None, None, None, None)
        return
    found = asked.nearest(rows)
    if kind == "distance":
        yield from ((distance,) for distance in found.distance_m.tolist())
        return
    headings = np.degrees(np.arctan2(found.tangents[:, 1], found.tangents[:, 0]))
    for row, (x, y) in enumerate(found.points.tolist()):
        yield (
            *(x, y, float(found.distance_m[row])),
            "free" if found.free_side[row] else "behind",
            *(float(headings[row]), int(found.curve_id[row]), float(found.tau_m[row])),
        )


def _batches(lines: Iterator[str], kind: str, at_once: int) -> Iterator[list[Row]]:
    """Rows of CSV, so many at a time; a header tells the order of the columns."""
    wanted = COLUMNS[kind]
    reader = csv.reader(line for line in lines if line.strip() and not line.startswith("#"))
    first = next(reader, None)
    order = list(range(len(wanted)))
    rest: Iterable[list[str]] = reader
    if first is not None and any(cell.strip() in wanted for cell in first):
        names = [cell.strip() for cell in first]
        missing = [name for name in wanted if name not in names]
        if missing:
            raise LogError(f"the points have no column {missing[0]}: name {', '.join(wanted)}")
        order = [names.index(name) for name in wanted]
    elif first is not None:
        rest = _chained(first, reader)
    rows = iter(rest)
    while batch := [
        _numbers([cells[k] for k in order if k < len(cells)], kind, ",".join(cells), LogError)
        for cells in islice(rows, at_once)
    ]:
        yield batch


def _chained(first: list[str], rest: Iterator[list[str]]) -> Iterator[list[str]]:
    yield first
    yield from rest


def _numbers(cells: list[str], kind: str, shown: str, blame: type[BsmapError] = UsageError) -> Row:
    wanted = COLUMNS[kind]
    try:
        row = tuple(float(cell) for cell in cells)
    except ValueError:
        row = ()
    if len(row) != len(wanted) or not all(math.isfinite(value) for value in row):
        raise blame(f"{shown!r} is no point: give {','.join(wanted)}")
    return row


def _cell(value: object) -> str:
    if value is None:
        return ""
    return f"{value:.6f}" if isinstance(value, float) else str(value)
