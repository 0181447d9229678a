"""Maps as DXF of AutoCAD 2000: a clamped SPLINE for each drawn piece of a curve, in metres."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import BinaryIO

import numpy as np

from bsmap_cli.exchange.clamping import ClampedCurve, clamped_pieces
from bsmap_cli.exchange.dxf_frame import MODEL_SPACE, Handles, Tags, frame_head, frame_tail
from bsmap_cli.exchange.flatten import TOLERANCE_M, simplified
from bsmap_cli.exchange.selection import Selection
from bsmap_cli.geometry.se2 import Points

PATH_LAYER = "path"
PLANAR = 8
APPLICATION = "BSMAP"


def write_dxf(stream: BinaryIO, selection: Selection) -> None:
    """Write one layer `curves STEP` for each level, and the path as a polyline.

    SPLINE entities carry degree, knots and control points, clamped where a piece begins and ends,
    because programs draw unclamped ones over their whole knot range; their extended data hold the
    curve's id.
    """
    layers = [f"curves {selected.level.knot_step_m:g}" for selected in selection.levels]
    handles = Handles()
    path = selection.path[:, :2] if len(selection.path) > 1 else None
    head = _text(frame_head([*layers, PATH_LAYER], _extent(selection), handles))
    entities = sum(len(selected.pieces.curve) for selected in selection.levels)
    seed = handles.behind(entities + (path is not None))
    stream.write(head.replace(Handles.SEED_MARK.encode(), seed.encode(), 1))
    for layer, selected in zip(layers, selection.levels, strict=True):
        for part in selected.portions():
            ids, degree = part.level.curve_ids, part.level.degree
            for curve in clamped_pieces(part):
                stream.write(_text(_spline(curve, layer, degree, int(ids[curve.curve]), handles)))
    if path is not None:
        stream.write(_text(_polyline(simplified(path, TOLERANCE_M), handles)))
    stream.write(_text(frame_tail(handles)))


def _text(tags: Iterable[tuple[int, str]]) -> bytes:
    return "".join(f"{code}\n{value}\n" for code, value in tags).encode("ascii")


def _extent(selection: Selection) -> tuple[Points, Points]:
    corners = []
    for selected in selection.levels:
        for part in selected.portions():
            points = np.concatenate([curve.control_points for curve in clamped_pieces(part)])
            corners += [points.min(axis=0), points.max(axis=0)]
    cloud = np.array(corners or [[0.0, 0.0]])
    return cloud.min(axis=0), cloud.max(axis=0)


def _entity(kind: str, layer: str, subclass: str, handles: Handles) -> Tags:
    return [
        (0, kind),
        (5, handles.next()),
        (330, MODEL_SPACE),
        (100, "AcDbEntity"),
        (8, layer),
        (100, subclass),
    ]


def _spline(
    curve: ClampedCurve, layer: str, degree: int, curve_id: int, handles: Handles
) -> Iterator[tuple[int, str]]:
    yield from _entity("SPLINE", layer, "AcDbSpline", handles)
    yield from ((210, "0.0"), (220, "0.0"), (230, "1.0"))
    yield from ((70, str(PLANAR)), (71, str(degree)))
    yield from ((72, str(len(curve.knots))), (73, str(len(curve.control_points))), (74, "0"))
    yield from ((42, "1e-09"), (43, "1e-09"))
    yield from ((40, f"{knot:.9f}") for knot in curve.knots.tolist())
    for x, y in curve.control_points.tolist():
        yield from ((10, f"{x:.9f}"), (20, f"{y:.9f}"), (30, "0.0"))
    yield from ((1001, APPLICATION), (1000, f"curve {curve_id}"))


def _polyline(points: Points, handles: Handles) -> Iterator[tuple[int, str]]:
    yield from _entity("LWPOLYLINE", PATH_LAYER, "AcDbPolyline", handles)
    yield from ((90, str(len(points))), (70, "0"), (43, "0.0"))
    for x, y in points.tolist():
        yield from ((10, f"{x:.9f}"), (20, f"{y:.9f}"))
