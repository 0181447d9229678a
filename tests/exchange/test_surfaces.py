import json

import numpy as np

from bsmap_cli.exchange.surfaces import surfaces_geojson
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.world import Guest, World, arc, box, gather, polyline


def world():
    bow = arc(1.0, 2.0, 4.0, 30.0, 200.0)
    crate = Guest(shapes=box(0.0, 0.0, 1.0, 1.0), motion=SE2(3.0, 0.0, 0.0), to_s=12.5)
    return World(gather((polyline((0.0, 0.0), (1.0, 0.5), (2.0, 0.0)), bow)), (crate,))


def test_a_line_string_a_surface_in_a_named_frame():
    document = json.loads(surfaces_geojson(world().surfaces()))
    assert document["type"] == "FeatureCollection"
    assert document["bsmap:frame"] == "world"
    kinds = [feature["properties"]["kind"] for feature in document["features"]]
    assert kinds == ["segment", "segment", "arc"] + ["segment"] * 4
    assert document["features"][0]["geometry"] == {
        "type": "LineString",
        "coordinates": [[0.0, 0.0], [1.0, 0.5]],
    }


def test_what_goes_says_when():
    features = json.loads(surfaces_geojson(world().surfaces()))["features"]
    assert all("to_s" not in feature["properties"] for feature in features[:3])
    assert all(feature["properties"]["to_s"] == 12.5 for feature in features[3:])
    corners = {tuple(point) for f in features[3:] for point in f["geometry"]["coordinates"]}
    assert corners == {(2.5, -0.5), (3.5, -0.5), (3.5, 0.5), (2.5, 0.5)}


def test_chords_of_an_arc_stay_within_a_tenth_of_a_millimetre():
    features = json.loads(surfaces_geojson(world().surfaces()))["features"]
    points = np.array(features[2]["geometry"]["coordinates"]) - (1.0, 2.0)
    middles = (points[1:] + points[:-1]) / 2
    assert np.abs(np.hypot(*points.T) - 4.0).max() < 2e-6
    assert np.abs(np.hypot(*middles.T) - 4.0).max() < 1e-4
    ends = np.degrees(np.arctan2(points[[0, -1], 1], points[[0, -1], 0])) % 360.0
    assert np.allclose(ends, [30.0, 230.0], atol=1e-4)
