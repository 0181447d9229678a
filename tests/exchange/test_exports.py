"""What is selected reaches the writers: levels, clips and tolerances; bytes repeat."""

import numpy as np
import pytest

from bsmap_cli.exchange.control_points import write_control_points
from bsmap_cli.exchange.dxf import write_dxf
from bsmap_cli.exchange.geojson import write_geojson
from bsmap_cli.exchange.page import write_page
from bsmap_cli.exchange.ply import write_ply
from bsmap_cli.exchange.selection import select, selected_document
from bsmap_cli.exchange.svg import write_svg
from bsmap_cli.exchange.viewer_mcap import write_viewer_mcap
from bsmap_cli.mapping.map_document import MapDocument
from tests.exchange.exported import wavy_document, written
from tests.maps import room_document

WRITERS = (
    write_control_points,
    write_dxf,
    write_geojson,
    write_page,
    write_ply,
    write_svg,
    write_viewer_mcap,
)
writers = pytest.mark.parametrize("writer", WRITERS, ids=lambda writer: writer.__name__)


@writers
def test_the_same_selection_gives_the_same_bytes(writer):
    first, second = (written(writer, select(wavy_document())) for _ in range(2))
    assert first == second


@writers
def test_level_and_clip_change_what_is_written(writer):
    levels = wavy_document(levels=(0.2, 0.1)).levels
    document = MapDocument(degree=3, max_weight=50, levels=levels)
    selections = [
        select(document),
        select(document, level=0.2),
        select(document, clip=(-12.5, 33.0, -10.5, 36.0)),
    ]
    assert len({written(writer, selection) for selection in selections}) == 3


@pytest.mark.parametrize("writer", [write_geojson, write_viewer_mcap])
def test_tolerances_reach_lines(writer):
    sizes = [
        len(written(writer, select(wavy_document()), tolerance_m=tolerance))
        for tolerance in (0.0, 1e-3, 0.05)
    ]
    assert sizes[0] > sizes[1] > sizes[2]


def test_a_clipped_map_keeps_whole_curves():
    document = selected_document(select(room_document(), clip=(3.0, 1.0, 5.0, 3.0)))
    assert document.finest.curve_ids.tolist() == [5]
    np.testing.assert_array_equal(
        document.finest.control_points, room_document().finest.control_points[-32:]
    )
