"""The span index against a search through all spans, after any history of merges."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.geometry.kernels import polynomial_jet, span_polynomial
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.curve_map import USABLE_WEIGHT
from bsmap_cli.mapping.span_index import EMPTY, cell_key, nearest_span
from tests.mapping.walls import MATRIX, STEP, arc, insert, line, live_curves, new_map

seeds = st.integers(0, 2**32)


def random_map(seed, scans=12, rows=256, *, trimmed=False):
    """Walls and arcs seen again and again in parts, from an almost empty start to many curves."""
    random = np.random.default_rng(seed)
    curve_map = new_map(rows=rows)
    corners = random.uniform(-3.0, 3.0, (6, 2))
    for _ in range(scans):
        a, b = corners[random.permutation(6)[:2]]
        low, high = np.sort(random.uniform(0.0, 1.0, 2))
        parts = [line(a + low * (b - a), a + high * (b - a) + (0.3, 0.0))]
        if random.random() < 0.5:
            begin = random.uniform(-3.0, 3.0)
            parts.append(arc(corners[0], 0.6, begin, begin - random.uniform(0.5, 3.0)))
        insert(curve_map, *parts)
        if trimmed:
            curve_map.trim()
    return curve_map


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_a_trimmed_map_holds_the_same_and_still_grows(seed):
    kept, trimmed = random_map(seed), random_map(seed, trimmed=True)
    assert len(trimmed.arrays.weights) == trimmed.arrays.sizes[1]
    for one, other in zip(live_curves(kept), live_curves(trimmed), strict=True):
        for value, expected in zip(other, one, strict=True):
            assert np.array_equal(value, expected)


def usable_spans(curve_map):
    """Rows of the spans that data support, from first principles."""
    arrays, rows = curve_map.arrays, []
    for curve, (first, points, weights, support) in enumerate(live_curves(curve_map)):
        for span in range(len(points) - 3):
            u = first + 3 + span
            seen = weights[span : span + 4].min() >= USABLE_WEIGHT
            if seen and u < support[1] and u + 1 > support[0]:
                rows.append(int(arrays.offset[curve]) + span)
    return sorted(rows)


def span_ends(curve_map, row):
    polynomial = np.empty((4, 2))
    span_polynomial(curve_map.arrays.points, row, MATRIX, polynomial)
    return np.array([polynomial_jet(polynomial, f)[:2] for f in (0.0, 1.0)])


def brute_force(chords, point, direction, gate, min_cosine):
    """Distance to the nearest of the (n, 2, 2) chords that runs along `direction`."""
    a, way = chords[:, 0], chords[:, 1] - chords[:, 0]
    squared = (way**2).sum(axis=1)
    share = np.clip(((point - a) * way).sum(axis=1) / squared, 0.0, 1.0)
    distance = np.hypot(*(point - a - share[:, None] * way).T)
    distance[way @ direction <= min_cosine * np.sqrt(squared)] = np.inf
    return distance.min() if distance.min() < gate else np.inf


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_every_usable_span_is_in_exactly_one_cell_and_no_other_is(seed):
    curve_map = random_map(seed)
    arrays = curve_map.arrays
    found = []
    for slot in np.flatnonzero(arrays.cell_keys != EMPTY):
        row = arrays.cell_heads[slot]
        while row >= 0:
            assert arrays.span_cell[row] == slot
            middle = span_ends(curve_map, row).mean(axis=0)
            column, line_ = np.floor(middle / STEP).astype(int)
            assert arrays.cell_keys[slot] == cell_key(column, line_)
            found.append(int(row))
            row = arrays.next_span[row]
    assert sorted(found) == sorted(usable_spans(curve_map))
    assert sorted(np.flatnonzero(arrays.span_cell >= 0)) == sorted(found)
    assert arrays.sizes[2] == np.count_nonzero(arrays.cell_keys != EMPTY)


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_nearest_span_equals_brute_force_within_half_a_knot_step(seed):
    curve_map = random_map(seed)
    random = np.random.default_rng(seed)
    gate = 0.5 * STEP
    chords = np.array([span_ends(curve_map, row) for row in usable_spans(curve_map)])
    for _ in range(100):
        if random.random() < 0.8:  # near a span: that is where it must answer
            ends = chords[random.integers(len(chords))]
            point = ends[0] + random.random() * (ends[1] - ends[0])
            point = point + random.normal(0.0, 0.03, 2)
        else:
            point = random.uniform(-3.0, 3.0, 2)
        angle = random.uniform(-np.pi, np.pi)
        direction = np.array([np.cos(angle), np.sin(angle)])
        row, f = nearest_span(curve_map.arrays, STEP, *point, *direction, gate, 0.5)
        expected = brute_force(chords, point, direction, gate, 0.5)
        if row < 0:
            assert expected == np.inf
            continue
        a, b = span_ends(curve_map, row)
        assert 0.0 <= f <= 1.0
        assert np.hypot(*(point - a - f * (b - a))) == pytest.approx(expected, abs=1e-9)


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_a_map_that_had_to_grow_equals_one_that_had_room(seed):
    cramped, roomy = random_map(seed, scans=25, rows=64), random_map(seed, scans=25, rows=20000)
    assert len(cramped.arrays.weights) < 20000
    for small, large in zip(live_curves(cramped), live_curves(roomy), strict=True):
        assert small[0] == large[0]
        assert all(np.array_equal(a, b) for a, b in zip(small[1:], large[1:], strict=True))


@given(seeds, st.integers(1, 5000))
@settings(max_examples=10, deadline=None)
def test_reserve_keeps_curves_and_index(seed, rows):
    curve_map = random_map(seed, scans=6)
    before, spans = live_curves(curve_map), usable_spans(curve_map)
    curve_map.reserve(rows)
    for old, new in zip(before, live_curves(curve_map), strict=True):
        assert all(np.array_equal(a, b) for a, b in zip(old, new, strict=True))
    assert sorted(np.flatnonzero(curve_map.arrays.span_cell >= 0)) == spans


def test_a_hundred_curves_outgrow_the_first_arrays():
    curve_map = new_map(rows=16)
    for k in range(150):
        insert(curve_map, line((0, k), (1, k)))
    assert len(curve_map) == 150
    assert len(usable_spans(curve_map)) == np.count_nonzero(curve_map.arrays.span_cell >= 0)


@given(seeds, st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.1, 3.1))
@settings(max_examples=15, deadline=None)
def test_moved_map_is_the_same_map_elsewhere(seed, x, y, theta):
    pose, curve_map = SE2(x, y, theta), random_map(seed, scans=5)
    moved = curve_map.moved(pose)
    for old, new in zip(live_curves(curve_map), live_curves(moved), strict=True):
        assert new[1] == pytest.approx(pose.transform(old[1]), abs=1e-12 * (60 + abs(x)))
        assert np.array_equal(old[2], new[2])
    assert usable_spans(moved) == usable_spans(curve_map)
    assert sorted(np.flatnonzero(moved.arrays.span_cell >= 0)) == usable_spans(curve_map)


def test_the_far_side_of_a_thin_wall_is_never_found():
    curve_map = new_map()
    insert(curve_map, line((0, 0), (1, 0)))
    row, _ = nearest_span(curve_map.arrays, STEP, 0.5, 0.01, -1.0, 0.0, 0.075, 0.5)
    assert row < 0
    row, _ = nearest_span(curve_map.arrays, STEP, 0.5, 0.01, 1.0, 0.0, 0.075, 0.5)
    assert row >= 0


@pytest.mark.parametrize("x", [-1e6, -0.05, 0.0, 3e5])
def test_cells_far_from_the_origin_and_of_either_sign(x):
    curve_map = new_map()
    insert(curve_map, line((x, -x), (x + 1.0, -x)))
    row, _ = nearest_span(curve_map.arrays, STEP, x + 0.5, 0.02 - x, 1.0, 0.0, 0.05, 0.5)
    assert row >= 0
