"""All formats by name: none is empty, all repeat their bytes, levels and clips reach each."""

import io
import json

import numpy as np
import pytest
from PIL import Image

from bsmap_cli.exchange.exports import EXPORTERS, TEXT_FORMATS, ExportOptions, export_map
from bsmap_cli.exchange.map_json import read_map_json
from bsmap_cli.exchange.selection import select, selected_document
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.sensor.trajectory import Trajectory
from tests.exchange.exported import wavy_document, written
from tests.maps import room_document


def both_levels():
    levels = wavy_document(levels=(0.2, 0.1)).levels
    return MapDocument(degree=3, max_weight=50, levels=levels)


@pytest.mark.parametrize("format_", EXPORTERS)
def test_the_same_selection_gives_the_same_bytes(format_):
    first, second = (written(export_map, select(wavy_document()), format_) for _ in range(2))
    assert first == second
    assert len(first) > 500
    if format_ in TEXT_FORMATS:
        first.decode("utf-8")


@pytest.mark.parametrize("format_", EXPORTERS)
def test_level_and_clip_change_what_is_written(format_):
    document = both_levels()
    selections = [
        select(document),
        select(document, level=0.2),
        select(document, clip=(-12.5, 33.0, -10.5, 36.0)),
    ]
    texts = {written(export_map, selection, format_) for selection in selections}
    assert len(texts) == 3


def test_options_reach_their_formats():
    selection = select(wavy_document())
    for format_ in ("geojson", "mcap"):
        fine, coarse = (
            written(export_map, selection, format_, ExportOptions(tolerance_m=t))
            for t in (1e-4, 0.05)
        )
        assert len(coarse) < len(fine)


def test_png_shows_the_clip_and_the_trajectory():
    trajectory = Trajectory(np.array([0, 1]), np.array([[2.5, 2.5, 0.0], [3.0, 2.5, 0.0]]))
    selection = select(room_document(), clip=(2.0, 1.0, 4.0, 3.0), trajectory=trajectory)
    image = Image.open(io.BytesIO(written(export_map, selection, "png"))).convert("RGB")
    pixels = np.asarray(image).astype(int)
    width = pixels.shape[1]
    assert abs(pixels.shape[0] - 110 - width) <= 1  # a square and the footer
    column, row = width * 0.75 / 2.0, width * (3.0 - 2.5) / 2.0
    near = pixels[round(row) - 3 : round(row) + 4, round(column)]
    assert (near[:, 0] - near[:, 1]).max() > 60  # the path is red


def test_a_clipped_map_keeps_whole_curves():
    document = selected_document(select(room_document(), clip=(3.0, 1.0, 5.0, 3.0)))
    assert document.finest.curve_ids.tolist() == [5]
    np.testing.assert_array_equal(
        document.finest.control_points, room_document().finest.control_points[-32:]
    )


def test_json_of_a_level_is_a_map_of_that_level():
    data = written(export_map, select(both_levels(), level=0.2), "json")
    assert [level["knot_step_m"] for level in json.loads(data)["levels"]] == [0.2]
    assert len(read_map_json(io.BytesIO(data)).finest) == 3
