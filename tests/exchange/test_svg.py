"""The SVG drawing: its paths are the curves, and rasterisers draw them to scale."""

import io
import itertools
import re
from xml.etree import ElementTree

import numpy as np
import pytest
import resvg_py
from PIL import Image

from bsmap_cli.exchange.selection import select
from bsmap_cli.exchange.svg import write_svg
from bsmap_cli.mapping.map_document import MapDocument
from tests.exchange.exported import (
    assert_same_lines,
    distances,
    drawn_lines,
    wavy_document,
    written,
)
from tests.maps import make_level, room_document

NAMESPACE = {"s": "http://www.w3.org/2000/svg"}


def drawing(document, **options):
    return written(write_svg, select(document, **options))


def curve_lines(path):
    """The polylines of the `d` of M, C and Q commands, flattened plainly."""
    lines, t = [], np.linspace(0, 1, 20)[:, None]
    for start, letter, rest in re.findall(r"M(\S+) ([CQ])([^M]*)", path.get("d")):
        points = np.array([[float(v) for v in p.split(",")] for p in [start, *rest.split()]])
        at, line, width = points[0], [points[:1]], {"C": 3, "Q": 2}[letter]
        for k in range(1, len(points), width):
            control = [at, *points[k : k + width]]
            while len(control) > 1:  # de Casteljau
                control = [(1 - t) * a + t * b for a, b in itertools.pairwise(control)]
            line.append(control[0][1:])
            at = points[k + width - 1]
        lines.append(np.concatenate(line))
    return lines


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_paths_are_the_curves(degree):
    document = wavy_document(degree)
    root = ElementTree.fromstring(drawing(document))
    paths = root.findall(".//s:g[@id='level-0.1']/s:path", NAMESPACE)
    assert [path.get("id") for path in paths] == ["curve-1", "curve-2", "curve-3"]
    assert [path.get("class") for path in paths] == ["weight-3", "weight-3", "weight-3"]
    lines = [line for path in paths for line in curve_lines(path)]
    assert len(lines) == 4
    assert_same_lines(lines, document.finest, 1e-4)


def test_weights_and_levels_are_told_apart():
    document = wavy_document(levels=(0.2, 0.1))
    both = MapDocument(
        degree=3, max_weight=50, levels=document.levels, parts=True, meta=document.meta
    )
    root = ElementTree.fromstring(drawing(both))
    ids = [path.get("id") for path in root.findall(".//s:path", NAMESPACE)]
    assert len(set(ids)) == len(ids)
    assert {"level-0.2-curve-1", "level-0.1-curve-1"} <= set(ids)
    (only,) = ElementTree.fromstring(drawing(document, level=0.2)).findall(
        ".//s:g[@id='level-0.2']", NAMESPACE
    )
    assert len(only) == 3


def test_the_map_is_drawn_to_scale():
    data = drawing(room_document())
    root = ElementTree.fromstring(data)
    box = [float(v) for v in root.get("viewBox").split()]
    width_mm = float(root.get("width").removesuffix("mm"))
    scale = float(re.search(rb"<title>map, 1:(\d+)</title>", data)[1])
    assert width_mm == pytest.approx(1000 * box[2] / scale)
    assert box[2] / box[3] == pytest.approx(width_mm / float(root.get("height").removesuffix("mm")))


def test_a_rasteriser_draws_the_walls_where_they_are():
    data = drawing(room_document(with_path=False)).decode()
    image = resvg_py.svg_to_bytes(svg_string=data, width=1400, dpi=96, background="white")
    pixels = np.asarray(Image.open(io.BytesIO(bytes(image))).convert("L"))
    x0, y0, width, _ = map(float, re.search(r'viewBox="(.*?)"', data)[1].split())
    dark_row, dark_column = np.nonzero(pixels < 215)
    scale = width / pixels.shape[1]
    points = np.column_stack((x0 + (dark_column + 0.5) * scale, -(y0 + (dark_row + 0.5) * scale)))
    walls = points[points[:, 1] > -0.05]  # the scale bar stands below
    lines = drawn_lines(room_document().finest)
    assert distances(walls, lines).max() < 0.02
    on_wall = np.array([[3.0, 0.0], [6.0, 2.0], [3.0, 4.0], [0.0, 2.0], [3.5, 2.0]])
    assert distances(on_wall, [[a, a + 1e-9] for a in walls]).max() < 0.01


def test_the_path_is_drawn_and_kept_to_the_millimetre():
    root = ElementTree.fromstring(drawing(wavy_document()))
    (path,) = root.findall(".//s:path[@id='path']", NAMESPACE)
    assert path.get("d") == "M-13,33.5 -12,33.6"


def test_an_empty_map_is_a_drawing_too():
    document = MapDocument(degree=3, max_weight=50, levels=(make_level([]),))
    assert ElementTree.fromstring(drawing(document)).find("s:g", NAMESPACE) is not None


def test_a_frame_name_cannot_break_the_drawing():
    document = MapDocument(
        degree=3, max_weight=50, levels=(make_level([]),), meta={"frame": "<map & co>"}
    )
    assert "<map & co>" in ElementTree.fromstring(drawing(document)).find("s:title", NAMESPACE).text
