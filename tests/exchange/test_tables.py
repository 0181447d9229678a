"""PLY, CSV and JSON: read back by others, or to the same map."""

import csv
import io
import json

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from scipy.interpolate import BSpline

from bsmap_cli.errors import MapFileError
from bsmap_cli.exchange.control_points import write_control_points
from bsmap_cli.exchange.map_json import (
    document_from_json,
    document_to_json,
    read_map_json,
    write_map_json,
)
from bsmap_cli.exchange.ply import write_ply
from bsmap_cli.exchange.selection import select
from tests.exchange.exported import (
    assert_same_lines,
    distances,
    drawn_lines,
    wavy_document,
    written,
)
from tests.mapping.test_map_file import assert_same, documents
from tests.maps import room_document


def test_ply_vertices_lie_on_the_curves_with_their_normals():
    document = wavy_document()
    data = written(write_ply, select(document))
    cloud = trimesh.load(io.BytesIO(data), file_type="ply", process=False)
    points = np.asarray(cloud.vertices)
    assert (points[:, 2] == 0.0).all()
    truth = drawn_lines(document.finest)
    assert distances(points[:, :2], truth).max() < 1e-5
    # every curve is sampled to its ends
    assert distances(np.concatenate(truth), [points[:, :2]]).max() < 0.05
    raw = cloud.metadata["_ply_raw"]["vertex"]["data"]
    turn = raw["curve_id"] == 2  # counter-clockwise round (-10, 33): the free side is inside
    inward = np.array([-10.0, 33.0]) - points[turn, :2]
    normal = np.column_stack((raw["nx"], raw["ny"]))[turn]
    assert ((inward * normal).sum(axis=1) > 0.3).all()
    assert set(raw["curve_id"].tolist()) == {1, 2, 3}


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_csv_is_all_that_a_spline_library_needs(degree):
    document = wavy_document(degree)
    text = written(write_control_points, select(document)).decode()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert len(rows) == len(document.finest.weights)
    lines = []
    for curve_id in ("1", "2", "3"):
        own = [row for row in rows if row["curve_id"] == curve_id]
        step, g = float(own[0]["knot_step_m"]), int(own[0]["lattice_index"])
        assert [int(row["lattice_index"]) for row in own] == list(range(g, g + len(own)))
        points = np.array([[float(row["x_m"]), float(row["y_m"])] for row in own])
        spline = BSpline((g + np.arange(len(own) + degree + 1)) * step, points, degree)
        begin, end = (g * step + float(own[0][f"tau_{name}_m"]) for name in ("start", "end"))
        line = spline(np.linspace(begin, end, 4000))
        if curve_id != "1":
            lines.append(line)
            continue
        (hole,) = (k for k, row in enumerate(own) if row["weight"] == "0")
        u = np.linspace(begin, end, 4000) / step - g
        lines += [line[u <= hole], line[u >= hole + degree + 1]]
    assert_same_lines(lines, document.finest)


def test_csv_of_a_clip_leaves_out_whole_curves():
    text = written(write_control_points, select(room_document(), clip=(3, 1, 5, 3))).decode()
    assert {row["curve_id"] for row in csv.DictReader(io.StringIO(text))} == {"5"}


@given(documents())
@settings(max_examples=40, deadline=None)
def test_json_comes_back_without_a_change(document):
    assert_same(read_map_json(io.BytesIO(written(write_map_json, document))), document)
    assert_same(document_from_json(json.loads(json.dumps(document_to_json(document)))), document)


def test_json_has_a_line_for_each_curve_and_short_numbers():
    text = written(write_map_json, room_document()).decode()
    assert len(text.splitlines()) == 1 + 5 + 1
    assert '"tau_start_m":0.3,' in text


def broken(**changes):
    document = document_to_json(room_document())
    document.update(changes)
    return document


def level_without(name):
    level = document_to_json(room_document())["levels"][0]
    del level["curves"][2][name]
    return [level]


@pytest.mark.parametrize(
    ("document", "message"),
    [
        (3, "not a map in JSON"),
        ({}, "not a map in JSON"),
        (broken(version=2), "expected a bsmap map of version 1 in JSON, found bsmap of version 2"),
        (broken(levels=[]), "expected 1 to 255 levels"),
        (broken(degree=7), "expected a degree from 2 to 5, found 7"),
        (broken(levels=level_without("curve_id")), "not a map in JSON: KeyError"),
        (broken(levels=level_without("weights")), "not a map in JSON: KeyError"),
        (broken(path=[[1.0, 2.0]]), "not a map in JSON: ValueError"),
        (broken(path=[[1.0, 2.0, float("nan")]]), "expected a finite path"),
    ],
)
def test_what_is_no_map_in_json(document, message):
    with pytest.raises(MapFileError, match=message):
        document_from_json(document)


def test_weights_and_points_must_be_as_many():
    document = document_to_json(room_document())
    document["levels"][0]["curves"][0]["weights"].pop()
    with pytest.raises(MapFileError, match="as many weights"):
        document_from_json(document)


def test_text_that_is_no_json():
    with pytest.raises(MapFileError, match="not a map in JSON"):
        read_map_json(io.BytesIO(b"{"))
