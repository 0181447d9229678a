"""Maps as SVG: one path of Bezier segments for each curve, in metres, with a scale bar."""

from __future__ import annotations

from typing import BinaryIO
from xml.sax.saxutils import escape

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.exchange.bezier import bezier_pieces
from bsmap_cli.exchange.flatten import simplified
from bsmap_cli.exchange.rounding import round_length
from bsmap_cli.exchange.selection import SelectedLevel, Selection
from bsmap_cli.geometry.se2 import Points

DECIMALS = 5  # of metres
PAPER_MM = 400.0  # the longer side of the drawing is at most this long
MARGIN = 0.05  # of the longer side
STROKE = 0.0015  # of the longer side
WEIGHT_CLASSES = 5
SHADES = ("#9db4c8", "#7796b5", "#52789f", "#2f5a86", "#123b66")
PATH_COLOUR = "#d1495b"
PATH_TOLERANCE_M = 0.001


def write_svg(stream: BinaryIO, selection: Selection) -> None:
    """Write the drawing, to scale: user units are metres of the map, 1:N on paper.

    Within `<g id="map">` y points up and coordinates are those of the map's frame. Each curve is
    one path `curve-ID` (`level-STEP-curve-ID` where there are several levels) of the class
    `weight-1` to `weight-5`; its weight, its tau and its flags stand in `data-` attributes.
    """
    x0, y0, x1, y1 = _bounds(selection)
    side = max(x1 - x0, y1 - y0)
    scale = 1.0 / round_length(PAPER_MM / 1000.0 / side)
    millimetres = [f"{1000.0 * length / scale:.6g}mm" for length in (x1 - x0, y1 - y0)]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{millimetres[0]}"'
        f' height="{millimetres[1]}" viewBox="{_number(x0)} {_number(-y1)} {_number(x1 - x0)}'
        f' {_number(y1 - y0)}">',
        f"<title>{escape(selection.frame)}, 1:{scale:g}</title>",
        "<style>",
        f"#map {{ fill: none; stroke-width: {STROKE * side:.4g}; stroke-linecap: round;"
        " stroke-linejoin: round }",
        *(f".weight-{k + 1} {{ stroke: {SHADES[k]} }}" for k in range(WEIGHT_CLASSES)),
        f"#path {{ stroke: {PATH_COLOUR}; stroke-width: {STROKE * side / 2:.4g} }}",
        "</style>",
        '<g id="map" transform="scale(1 -1)" fill="none">',  # for programs that read no styles
    ]
    several = len(selection.levels) > 1
    for selected in selection.levels:
        step = f"level-{selected.level.knot_step_m:g}"
        lines.append(f'<g id="{step}">')
        prefix = f"{step}-" if several else ""
        for part in selected.portions():
            lines += _curves(part, prefix, selection.document.max_weight)
            stream.write("\n".join([*lines, ""]).encode())
            lines = []
        lines.append("</g>")
    if len(selection.path):
        lines.append(f'<path id="path" d="{_polyline(selection.path[:, :2])}"/>')
    lines += ["</g>", *_scale_bar(x0, -y0, side), "</svg>", ""]
    stream.write("\n".join(lines).encode())


def _curves(selected: SelectedLevel, prefix: str, max_weight: int) -> list[str]:
    level, beziers = selected.level, bezier_pieces(selected)
    rows = level.offsets()
    lines = []
    for curve, own in selected.by_curve():
        weights = level.weights[rows[curve] : rows[curve + 1]].astype(float)
        weight = float(weights[weights > 0].mean())
        kind = min(int(weight / max(max_weight, 1) * WEIGHT_CLASSES), WEIGHT_CLASSES - 1) + 1
        shape = " ".join(_bezier_path(segments) for segments in beziers[own])
        lines.append(
            f'<path id="{prefix}curve-{level.curve_ids[curve]}" class="weight-{kind}"'
            f' data-weight="{weight:.3g}" data-tau="{level.tau_start_m[curve]!s}'
            f' {level.tau_end_m[curve]!s}" data-flags="{level.flags[curve]}" d="{shape}"/>'
        )
    return lines


def _bezier_path(segments: NDArray[np.float64]) -> str:
    letter = "C" if segments.shape[1] == 4 else "Q"
    first, *rest = _points(np.concatenate((segments[:1, 0], segments[:, 1:].reshape(-1, 2))))
    return f"M{first} {letter}{' '.join(rest)}"


def _polyline(points: Points) -> str:
    return "M" + " ".join(_points(simplified(points, PATH_TOLERANCE_M)))


def _points(points: Points) -> list[str]:
    return [f"{_number(x)},{_number(y)}" for x, y in points.tolist()]


def _number(value: float) -> str:
    text = f"{value:.{DECIMALS}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _bounds(selection: Selection) -> tuple[float, float, float, float]:
    corners = []
    for selected in selection.levels:
        for part in selected.portions():
            hull = np.concatenate(bezier_pieces(part)).reshape(-1, 2)
            corners += [hull.min(axis=0), hull.max(axis=0)]
    points = np.array(corners or [[-1.0, -1.0], [1.0, 1.0]])
    (x0, y0), (x1, y1) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    margin = max(MARGIN * max(x1 - x0, y1 - y0), 0.01)
    return x0 - margin, y0 - margin, x1 + margin, y1 + margin


def _scale_bar(x0: float, bottom: float, side: float) -> list[str]:
    length = round_length(0.2 * side)
    x, y, tick = x0 + 0.015 * side, bottom - 0.02 * side, 0.006 * side
    text = f"{length:g} m" if length >= 1.0 else f"{100.0 * length:g} cm"
    numbers = [_number(v) for v in (x, y - tick, 2.0 * tick, length)]
    shape = f"M{numbers[0]} {numbers[1]}v{numbers[2]}m0 -{_number(tick)}"
    shape += f"h{numbers[3]}m0 -{_number(tick)}v{numbers[2]}"
    return [
        f'<path id="scale-bar" fill="none" stroke="#444" stroke-width="{STROKE * side:.4g}"'
        f' d="{shape}"/>',
        f'<text x="{_number(x + 0.5 * length)}" y="{_number(y - 1.5 * tick)}" fill="#444"'
        f' font-family="sans-serif" font-size="{0.018 * side:.4g}" text-anchor="middle">'
        f"{text}</text>",
    ]
