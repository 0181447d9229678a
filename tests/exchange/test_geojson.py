"""GeoJSON: read by another library, in metres and on Earth."""

import json

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from bsmap_cli.errors import UsageError
from bsmap_cli.exchange.geodesy import GeoOrigin
from bsmap_cli.exchange.geojson import write_geojson
from bsmap_cli.exchange.selection import select
from tests.exchange.exported import (
    assert_same_lines,
    distances,
    drawn_lines,
    wavy_document,
    written,
)


def collection(document, **options):
    return json.loads(written(write_geojson, select(document), **options))


def lines_of(document):
    shapes = [shapely.from_geojson(json.dumps(f["geometry"])) for f in document["features"]]
    assert all(shape.is_valid for shape in shapes)
    return [np.array(part.coords) for shape in shapes for part in shapely.get_parts(shape)]


def validate(document):
    """The rules of RFC 7946 for a collection of lines."""
    assert document["type"] == "FeatureCollection"
    for feature in document["features"]:
        assert set(feature) == {"type", "properties", "geometry"}
        assert feature["type"] == "Feature"
        assert isinstance(feature["properties"], dict)
        geometry = feature["geometry"]
        parts = {"LineString": [geometry["coordinates"]]}.get(
            geometry["type"], geometry["coordinates"]
        )
        assert geometry["type"] in ("LineString", "MultiLineString")
        for part in parts:
            assert len(part) >= 2
            assert all(len(position) == 2 for position in part)


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_lines_are_the_curves_in_metres_of_the_frame(degree):
    document = wavy_document(degree)
    found = collection(document)
    validate(found)
    assert found["bsmap:frame"] == "map"
    assert_same_lines(lines_of(found), document.finest)
    assert [f["properties"]["curve_id"] for f in found["features"]] == [1, 2, 3]
    assert [f["geometry"]["type"] for f in found["features"]] == [
        "MultiLineString",
        "LineString",
        "LineString",
    ]
    assert found["features"][0]["properties"] == {
        "curve_id": 1,
        "knot_step_m": 0.1,
        "weight": 20.0,
        "observations": 7,
        "closed": False,
        "tentative": False,
    }


def test_a_wider_tolerance_gives_fewer_vertices_within_it():
    document = wavy_document()
    lines = lines_of(collection(document, tolerance_m=0.02))
    fine = lines_of(collection(document))
    assert sum(map(len, lines)) < 0.5 * sum(map(len, fine))
    assert_same_lines(lines, document.finest, 0.02)


def on_earth(longitude_latitude):
    """(m, 3) geocentric metres of points on the ellipsoid (textbook formula)."""
    lon, lat = np.radians(longitude_latitude).T
    a, b = 6378137.0, 6356752.314245179
    n = a**2 / np.sqrt((a * np.cos(lat)) ** 2 + (b * np.sin(lat)) ** 2)
    return np.column_stack(
        (
            n * np.cos(lat) * np.cos(lon),
            n * np.cos(lat) * np.sin(lon),
            n * (b / a) ** 2 * np.sin(lat),
        )
    )


def local(longitude_latitude, latitude, longitude):
    """(m, 2) east and north in the plane that touches the ellipsoid at the origin."""
    lat, lon = np.radians([latitude, longitude])
    axes = np.array(
        [
            [-np.sin(lon), np.cos(lon), 0],
            [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)],
        ]
    )
    return (on_earth(longitude_latitude) - on_earth(np.array([[longitude, latitude]]))) @ axes.T


places = st.tuples(st.floats(-89.0, 89.0), st.floats(-180.0, 180.0), st.floats(-360.0, 360.0))


@given(places, st.floats(-500, 500), st.floats(-500, 500))
def test_the_way_back_from_earth(place, x, y):
    latitude, longitude, heading = place
    found = GeoOrigin(*place).longitude_latitude(np.array([[x, y]]))
    assert -180.0 <= found[0, 0] <= 180.0
    east, north = local(found, latitude, longitude)[0]
    h = np.radians(heading)
    assert east * np.sin(h) + north * np.cos(h) == pytest.approx(x, abs=1e-4)
    assert -east * np.cos(h) + north * np.sin(h) == pytest.approx(y, abs=1e-4)


def test_known_directions():
    east = GeoOrigin(0.0, 10.0, 90.0).longitude_latitude(np.array([[100.0, 0.0], [0.0, 100.0]]))
    np.testing.assert_allclose(east[0], [10.0 + np.degrees(100 / 6378137.0), 0.0], atol=1e-9)
    assert east[1, 0] == pytest.approx(10.0)
    assert east[1, 1] == pytest.approx(100 / 110574.3, rel=1e-4)  # a degree at the equator


def test_lines_on_earth_are_the_curves():
    document = wavy_document()
    origin = GeoOrigin(48.137, 11.575, 30.0)
    found = collection(document, origin=origin)
    validate(found)
    assert "bsmap:frame" not in found
    cos, sin = np.cos(np.radians(30.0)), np.sin(np.radians(30.0))
    back = [
        local(line, 48.137, 11.575) @ np.array([[sin, -cos], [cos, sin]])
        for line in lines_of(found)
    ]
    assert distances(np.concatenate(back), drawn_lines(document.finest)).max() < 0.001


@pytest.mark.parametrize("place", [(91.0, 0.0, 0.0), (0.0, 181.0, 0.0), (float("nan"), 0.0, 0.0)])
def test_no_place_on_earth(place):
    with pytest.raises(UsageError, match="no place on Earth"):
        GeoOrigin(*place)
