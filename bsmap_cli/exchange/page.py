"""A map as one page for a browser: nothing else is needed, no network, no server."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable
from html import escape
from importlib.resources import files
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.evaluation.map_statistics import drawn_length
from bsmap_cli.evaluation.pose_arrays import nearest_stamps
from bsmap_cli.exchange.selection import SelectedLevel, Selection
from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.mapping.sampling import drawn_pieces, sample_level
from bsmap_cli.sensor.scan import Scan

SCRIPTS = ("data.js", "view.js", "draw.js", "tools.js", "input.js")
# a page of a long log stays below a megabyte
MOST_POSES, MOST_SCANS, MOST_POINTS = 20_000, 600, 90
SCAN_QUANTUM_M = 0.01
POINT_LIMIT = 32767


def write_page(
    stream: BinaryIO, selection: Selection, *, title: str = "map", scans: Iterable[Scan] = ()
) -> None:
    """Write the page: all levels of the map, the selected ones shown at first.

    scans : shown while the path plays, thinned evenly; they need a trajectory in the selection.
    """
    folder = files("bsmap_cli.exchange") / "page_files"
    script = "\n".join((folder / name).read_text("utf-8") for name in SCRIPTS)
    data = json.dumps(_data(selection, scans), separators=(",", ":"), allow_nan=False)
    page = (folder / "page.html").read_text("utf-8")
    parts = {
        "title": escape(title),
        "style": (folder / "page.css").read_text("utf-8"),
        "data": data.replace("<", "\\u003c"),
        "script": script,
    }
    head, *rest = page.split("@")
    # the template alternates between text and names of parts
    pieces = [parts[piece] if number % 2 == 0 else piece for number, piece in enumerate(rest)]
    stream.write((head + "".join(pieces)).encode())


def _data(selection: Selection, scans: Iterable[Scan]) -> dict[str, Any]:
    document = selection.document
    chosen = {id(selected.level): selected for selected in selection.levels}
    levels = [
        _level(chosen.get(id(level)) or SelectedLevel(level, drawn_pieces(level)))
        | {"shown": id(level) in chosen}
        for level in document.levels
    ]
    data: dict[str, Any] = {
        "degree": document.degree,
        "matrix": basis_matrix(document.degree).tolist(),
        "max_weight": document.max_weight,
        "summary": _summary(selection),
        "levels": levels,
    }
    if len(selection.path):
        every = -(-len(selection.path) // MOST_POSES)
        data["path"] = _path(selection.path[::every], every)
        if selection.stamps_ns is not None:
            stamps_ns = selection.stamps_ns[::every]
            seconds = (stamps_ns - stamps_ns[0]) * 1e-9
            data["path"]["seconds"] = _packed(seconds, "<f4")
            count = len(selection.stamps_ns)
            data["scans"] = _scans(stamps_ns, scans, count, document.finest.knot_step_m)
    return data


def _summary(selection: Selection) -> str:
    words = []
    for selected in selection.levels:
        level = selected.level
        metres = sum(
            drawn_length(sample_level(part, level.knot_step_m / 2)) for _, part in level.portions()
        )
        words.append(
            f"{len(level):,} curves, {len(level.weights):,} control points,"
            f" {metres:,.0f} m at knot step {level.knot_step_m:g} m"
        )
    return " \u00b7 ".join(words)


def _level(selected: SelectedLevel) -> dict[str, Any]:
    level, pieces = selected.level, selected.pieces
    return {
        "step": level.knot_step_m,
        "ids": _packed(level.curve_ids, "<u4"),
        "counts": _packed(level.point_counts, "<u4"),
        "flags": _packed(level.flags, "<u2"),
        "seen": _packed(level.observations, "<u2"),
        "xy": _packed(level.control_points, "<f4"),
        "weights": _packed(level.weights, "u1"),
        "piece_curves": _packed(pieces.curve, "<u4"),
        "piece_bounds": _packed(np.stack((pieces.start, pieces.end), axis=1), "<f8"),
    }


def _path(poses: NDArray[np.float64], every: int) -> dict[str, Any]:
    return {"count": len(poses), "every": every, "poses": _packed(poses, "<f4")}


def _scans(
    stamps_ns: NDArray[np.int64], scans: Iterable[Scan], count: int, knot_step_m: float
) -> dict[str, Any] | None:
    """Returns of some of `count` scans in the base frame, each with the row of its pose."""
    from bsmap_cli.sensor.gate import SensorSettings, find_returns

    every = -(-count // MOST_SCANS)
    rows, clouds = [], []
    for number, scan in enumerate(scans):
        if number % every:
            continue
        points = find_returns(scan, SensorSettings(), knot_step_m).points_body
        points = points[:: -(-len(points) // MOST_POINTS) or 1]
        limit = POINT_LIMIT * SCAN_QUANTUM_M
        points = points[(np.abs(points) <= limit).all(axis=1)]
        rows.append(int(nearest_stamps(stamps_ns, np.array([scan.stamp_ns]))[0][0]))
        clouds.append(np.rint(points / SCAN_QUANTUM_M))
    if not rows:
        return None
    order = np.argsort(rows, kind="stable")
    ordered = [clouds[k] for k in order]
    return {
        "poses": _packed(np.array(rows)[order], "<u4"),
        "counts": _packed(np.array([len(cloud) for cloud in ordered]), "<u4"),
        "points": _packed(np.concatenate(ordered), "<i2"),
        "quantum": SCAN_QUANTUM_M,
    }


def _packed(array: NDArray[Any], kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(array, kind).tobytes()).decode()
