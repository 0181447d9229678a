"""Two maps of one lattice step become one: laws of the weighted mean, and what each map adds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.freeze import freeze_level
from bsmap_cli.mapping.fusion import fuse_level
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.queries import MapQuery
from bsmap_cli.mapping.sampling import sample_level
from bsmap_cli.mapping.thaw import thaw_level
from tests.maps import arc_points, line_points, make_level, room_document

SETTINGS = MappingSettings()
ROOM = room_document().finest


def fused(first, second, cap=255):
    grown = thaw_level(first)
    fuse_level(grown, second, SETTINGS)
    return freeze_level(grown, max_weight=cap)


def weighed(level, weight):
    return make_level(
        np.split(level.control_points.astype(float), level.offsets()[1:-1]),
        weights=np.full(len(level.weights), weight, np.uint8),
    )


def farthest_m(level, other):
    """The farthest that a drawn point of one level lies from the other."""
    return MapQuery(other).nearest(sample_level(level, 0.02).points).distance_m.max()


def test_a_map_fused_with_itself_keeps_its_curves_and_adds_up_its_weights():
    both = fused(ROOM, ROOM)
    assert np.array_equal(both.point_counts, ROOM.point_counts)
    assert np.array_equal(both.first_indices, ROOM.first_indices)
    assert np.abs(both.control_points - ROOM.control_points).max() < 1e-3
    inner = np.concatenate([np.arange(a + 3, b - 3) for a, b in spans(ROOM)])
    assert (both.weights[inner] == 10).all()
    assert (both.observations == 14).all()


def spans(level):
    return zip(level.offsets()[:-1], level.offsets()[1:], strict=True)


@given(st.integers(1, 60), st.integers(1, 60), st.floats(0.0, 0.03))
@settings(max_examples=25, deadline=None)
def test_a_wall_seen_twice_lies_at_the_weighted_mean(one, two, aside):
    first = make_level([line_points((0.0, 0.0), (4.0, 0.0), 0.1)])
    second = make_level([line_points((0.03, aside), (4.03, aside), 0.1)])
    both = fused(weighed(first, one), weighed(second, two))
    assert len(both) == 1
    heights = sample_level(both, 0.02).points
    inner = heights[(heights[:, 0] > 0.6) & (heights[:, 0] < 3.4), 1]
    assert inner == pytest.approx(aside * two / (one + two), abs=2e-4)
    assert (both.weights[6:-6] == one + two).all()


@given(st.integers(1, 40), st.integers(1, 40), st.floats(-0.02, 0.02), st.floats(-0.003, 0.003))
@settings(max_examples=8, deadline=None)
def test_the_order_does_not_matter(one, two, aside, turn):
    first, second = weighed(ROOM, one), weighed(ROOM.moved(SE2(aside, -aside, turn)), two)
    forth, back = fused(first, second), fused(second, first)
    # where one map's curve ends, its lattice decides how the mean goes over into the other's
    apart = math.sqrt(2.0) * abs(aside) + 7.2 * abs(turn)
    assert farthest_m(forth, back) < 0.002 + 0.5 * apart
    assert farthest_m(back, forth) < 0.002 + 0.5 * apart
    inner = np.array([[3.0, 0.0], [6.0, 2.0], [3.0, 4.0], [0.0, 2.0], [3.5, 2.2]])
    feet = [MapQuery(level).nearest(inner) for level in (forth, back)]
    assert feet[0].distance_m == pytest.approx(feet[1].distance_m, abs=5e-4)


def test_a_wall_goes_on_where_the_other_map_has_more_of_it():
    first = make_level([line_points((0.0, 0.0), (4.0, 0.0), 0.1)])
    second = make_level([line_points((2.53, 0.0), (7.03, 0.0), 0.1)])
    for both in (fused(first, second), fused(second, first)):
        assert len(both) == 1
        points = sample_level(both, 0.02).points
        assert points[:, 0].min() == pytest.approx(0.1, abs=0.01)
        assert points[:, 0].max() == pytest.approx(6.93, abs=0.01)
        assert np.abs(points[:, 1]).max() < 1e-3


def test_what_only_one_map_has_stays_as_it_is():
    pillar = make_level([arc_points((20.0, 0.0), 0.5, 2.0 * np.pi, 0.0, 0.1)])
    both = fused(ROOM, weighed(pillar, 9))
    assert len(both) == len(ROOM) + 1
    assert np.array_equal(both.control_points[: len(ROOM.weights)], ROOM.control_points)
    assert farthest_m(pillar, both) < 1e-3
    assert both.weights[-10] == 9
    assert both.observations[-1] == 7


def test_the_faces_of_a_thin_wall_stay_two():
    front = make_level([line_points((0.0, 0.0), (3.0, 0.0), 0.1)])
    back = make_level([line_points((3.0, 0.04), (0.0, 0.04), 0.1)])
    assert len(fused(front, back)) == 2
