"""Maps that are taken up again: as they were, and on other lattices."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.mapping.freeze import freeze_level
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.queries import MapQuery
from bsmap_cli.mapping.resampling import one_level, resampled_level
from bsmap_cli.mapping.sampling import sample_level
from bsmap_cli.mapping.thaw import thaw_level
from tests.mapping.walls import arc, insert, line, new_map
from tests.maps import make_level, room_document
from tests.slam.rooms import map_of, room_parts


def assert_same(found, expected):
    for entry in fields(expected):
        assert np.array_equal(getattr(found, entry.name), getattr(expected, entry.name)), entry.name


@given(st.integers(1, 9), st.floats(-50.0, 50.0))
@settings(max_examples=20, deadline=None)
def test_a_frozen_map_thaws_to_itself(times, shift):
    frozen = freeze_level(map_of([part + shift for part in room_parts()], 0.2, times), max_weight=5)
    assert_same(freeze_level(thaw_level(frozen), max_weight=5), frozen)


def test_a_thawed_map_grows_like_the_one_it_was():
    grown, more = map_of(room_parts()), line((0.4, 0.0), (9.0, 0.0), 0.02)
    thawed = thaw_level(freeze_level(grown, max_weight=50))
    insert(grown, more)
    insert(thawed, more)
    expected, found = (freeze_level(level, max_weight=50) for level in (grown, thawed))
    assert np.array_equal(found.point_counts, expected.point_counts)
    assert found.control_points == pytest.approx(expected.control_points, abs=1e-3)


def test_more_curves_than_an_empty_map_has_room_for():
    shelves = [line((0.0, y), (1.0, y), 0.02) for y in np.arange(0.0, 90.0, 0.5)]
    level = freeze_level(map_of(shelves), max_weight=50)
    assert len(level) == 180
    assert_same(freeze_level(thaw_level(level), max_weight=50), level)


def test_what_is_not_drawn_is_not_matched_against():
    level = room_document().finest
    weights = level.weights.copy()
    weights[20] = 0
    spans = [
        int((thaw_level(replace(level, weights=w)).arrays.span_cell >= 0).sum())
        for w in (level.weights, weights)
    ]
    assert spans[0] - spans[1] == 4  # as many spans as one control point has part in


@given(st.sampled_from([0.05, 0.2, 0.4]), st.floats(0.8, 5.0), st.floats(0.0, 6.0))
@settings(max_examples=40, deadline=None)
def test_a_resampled_curve_is_the_same_curve(step, radius, begin):
    grown = new_map()
    insert(grown, arc((1.0, 2.0), radius, begin, begin + 3.0 / radius, 0.02))
    level = freeze_level(grown, max_weight=50)
    other = resampled_level(level, step)
    assert other.knot_step_m == step
    assert len(other) == 1
    was, now = sample_level(level, 0.05), sample_level(other, 0.05)
    assert now.tau_m[[0, -1]] == pytest.approx(was.tau_m[[0, -1]], abs=1e-4 * step + 1e-6)
    off = MapQuery(level).nearest(now.points)
    # the ends of a curve go on a little too straight: a share of its second difference
    assert off.distance_m.max() < 0.05 * step**2 / radius + 5e-4
    assert np.einsum("mi,mi->m", off.tangents, now.tangents).min() > 0.99


def test_weights_and_pieces_survive_resampling():
    level = room_document().finest
    weights = level.weights.copy()
    weights[30] = 0  # cuts the first wall in two
    coarse = resampled_level(replace(level, weights=weights), 0.2)
    assert len(coarse) == len(level) + 1
    assert set(coarse.weights.tolist()) == {5}
    assert set(coarse.observations.tolist()) == {7}


def test_pieces_too_short_for_a_coarse_lattice_are_left_out():
    level = make_level([np.column_stack((np.arange(6) * 0.1, np.zeros(6)))])
    assert len(resampled_level(level, 0.2)) == 1
    assert len(resampled_level(level, 0.8)) == 0


def test_the_parts_of_a_map_become_one_level():
    fine = room_document(0.1).finest
    coarse = resampled_level(room_document(0.2).finest, 0.2)
    parts = MapDocument(degree=3, max_weight=50, levels=(coarse, fine), parts=True)
    assert one_level(replace(parts, parts=False)) is fine
    joined = one_level(parts)
    assert joined.knot_step_m == 0.1
    assert len(joined) == len(fine) + len(coarse)
