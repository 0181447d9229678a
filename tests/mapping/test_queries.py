"""Queries beside naive answers: dense samples for the nearest point, geometry for rays."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.mapping.queries import MapQuery
from bsmap_cli.mapping.sampling import drawn_pieces, evaluate, sample_level
from tests.maps import make_level, room_document

ROOM = room_document()
QUERY = MapQuery(ROOM.finest)
DENSE = sample_level(ROOM.finest, 1e-3).points
COORDINATE = st.floats(-2.0, 8.0)


@given(COORDINATE, COORDINATE)
def test_the_nearest_point_is_that_of_dense_samples(x, y):
    found = QUERY.nearest(np.array([[x, y]]))
    expected = np.hypot(*(DENSE - [x, y]).T).min()
    assert found.distance_m[0] <= expected + 1e-9
    assert found.distance_m[0] == pytest.approx(expected, abs=1e-3)


@given(COORDINATE, COORDINATE)
def test_the_way_to_a_foot_point_is_square_to_the_curve(x, y):
    found = QUERY.nearest(np.array([[x, y]]))
    along = abs(float((np.array([x, y]) - found.points[0]) @ found.tangents[0]))
    ends = sample_level(ROOM.finest, 100.0).points  # both ends of every piece
    at_end = np.hypot(*(ends - found.points[0]).T).min() < 1e-6
    assert at_end or along < 1e-6


def test_the_free_side_is_where_the_room_is():
    found = QUERY.nearest(np.array([[3.0, 0.2], [3.0, -0.2], [4.0, 1.2], [4.0, 1.8]]))
    assert found.free_side.tolist() == [True, False, True, False]
    assert found.distance_m[:2] == pytest.approx([0.2, 0.2], abs=1e-6)


@given(st.floats(0.5, 3.0), st.floats(0.5, 3.5), st.floats(-math.pi, math.pi))
def test_a_ray_in_the_room_meets_wall_or_pillar(x, y, angle):
    hit = QUERY.rays(np.array([[x, y]]), np.array([angle]))
    cos, sin = math.cos(angle), math.sin(angle)
    walls = [
        ((6.0 if cos > 0 else 0.0) - x) / cos if cos else math.inf,
        ((4.0 if sin > 0 else 0.0) - y) / sin if sin else math.inf,
    ]
    along = (4.0 - x) * cos + (2.0 - y) * sin
    across = abs((4.0 - x) * sin - (2.0 - y) * cos)
    radius = np.hypot(*(DENSE - [4.0, 2.0]).T).min()  # the spline runs a little inside
    if abs(across - radius) < 1e-3:
        return  # grazes the pillar
    if along > 0 and across < radius:
        walls.append(along - math.sqrt(radius**2 - across**2))
    meets_corner = min(
        np.hypot(*(hit.points[0] - c)) < 0.05 for c in ([0, 0], [6, 0], [0, 4], [6, 4])
    )
    if not meets_corner and np.isfinite(hit.range_m[0]):
        assert hit.range_m[0] == pytest.approx(min(walls), abs=2e-3)


def test_a_ray_that_meets_nothing_says_so():
    away = QUERY.rays(np.array([[-1.0, -1.0]]), np.array([-2.0]))
    assert away.range_m[0] == math.inf
    assert away.curve_id[0] == 0
    short = QUERY.rays(np.array([[3.0, 2.0]]), np.array([math.pi]), range_max_m=2.9)
    assert short.range_m[0] == math.inf


def test_many_questions_at_once_are_each_one_alone():
    random = np.random.default_rng(1)
    points, angles = random.uniform(-1, 7, (500, 2)), random.uniform(-4, 4, 500)
    together, hits = QUERY.nearest(points), QUERY.rays(points, angles)
    for row in range(0, 500, 50):
        alone = QUERY.nearest(points[row : row + 1])
        assert alone.distance_m[0] == pytest.approx(together.distance_m[row], abs=1e-12)
        ray = QUERY.rays(points[row : row + 1], angles[row : row + 1])
        assert ray.range_m[0] == hits.range_m[row]
        assert ray.curve_id[0] == hits.curve_id[row]


def test_a_map_without_curves_has_no_answer():
    empty = MapQuery(make_level([]))
    assert len(empty) == 0
    assert empty.rays(np.zeros((1, 2)), np.zeros(1)).range_m[0] == math.inf
    with pytest.raises(ValueError, match="draws no curve"):
        empty.nearest(np.zeros((1, 2)))


def wild_level(seed):
    """Curves that wander about, of any degree, some with holes, some far away."""
    random = np.random.default_rng(seed)
    step, degree = float(random.choice([0.05, 0.1, 0.4])), int(random.integers(2, 6))
    curves = []
    for _ in range(int(random.integers(1, 8))):
        count = int(random.integers(degree + 1, 40))
        turns = np.cumsum(random.normal(0.0, 0.4, count)) + random.uniform(-4.0, 4.0)
        moves = step * np.column_stack((np.cos(turns), np.sin(turns)))
        start = random.uniform(-2.0, 2.0, 2) * random.choice([1.0, 1.0, 20.0])
        curves.append(start + np.cumsum(moves, axis=0))
    total = sum(map(len, curves))
    weights = np.where(random.random(total) < 0.05, 0, 5)
    trim = float(random.uniform(0.0, 0.9))
    return make_level(curves, step, degree, weights=weights, trim=trim)


def chords_of(level):
    """Start, end and curve id of eight chords a span, of every span that is drawn."""
    pieces, starts, ends, ids = drawn_pieces(level), [], [], []
    for curve, begin, end in zip(pieces.curve, pieces.start, pieces.end, strict=True):
        for span in range(math.floor(begin), math.ceil(end)):
            u = np.linspace(max(begin, span), min(end, span + 1), 9)
            points, _ = evaluate(level, np.full(9, curve), u)
            starts.append(points[:-1])
            ends.append(points[1:])
            ids.append(np.full(8, level.curve_ids[curve]))
    return np.concatenate(starts), np.concatenate(ends), np.concatenate(ids)


@given(st.integers(0, 2**32))
@settings(deadline=None)
def test_rays_meet_what_asking_every_chord_finds(seed):
    level = wild_level(seed)
    if not len(drawn_pieces(level).curve):
        return
    start, end, _ = chords_of(level)
    random = np.random.default_rng(seed)
    origins, angles = random.uniform(-5.0, 5.0, (60, 2)), random.uniform(-4.0, 4.0, 60)
    angles[:8] = np.arange(8) * math.pi / 4
    found = MapQuery(level).rays(origins, angles)
    along = end - start
    for row, (origin, angle) in enumerate(zip(origins, angles, strict=True)):
        cos, sin = math.cos(angle), math.sin(angle)
        away = start - origin
        cross = cos * along[:, 1] - sin * along[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = (away[:, 0] * along[:, 1] - away[:, 1] * along[:, 0]) / cross
            share = (away[:, 0] * sin - away[:, 1] * cos) / cross
        inside = (share >= 0.0) & (share <= 1.0)
        if np.any((np.abs(share) < 1e-6) | (np.abs(share - 1.0) < 1e-6)):
            continue  # through the very end of a chord: rounding decides
        met = reach[(cross != 0.0) & (reach >= 0.0) & inside]
        assert found.range_m[row] == pytest.approx(met.min(initial=math.inf), abs=1e-9)


@given(st.integers(0, 2**32))
@settings(deadline=None)
def test_nothing_is_nearer_than_the_nearest_point(seed):
    level = wild_level(seed)
    if not len(drawn_pieces(level).curve):
        return
    dense = sample_level(level, level.knot_step_m / 100.0).points
    random = np.random.default_rng(seed)
    points = random.uniform(-5.0, 5.0, (40, 2)) * random.choice([1.0, 10.0], (40, 1))
    found = MapQuery(level).nearest(points)
    for point, foot, distance in zip(points, found.points, found.distance_m, strict=True):
        assert distance == pytest.approx(math.dist(point, foot), abs=1e-9)
        least = np.hypot(*(dense - point).T).min()
        assert least - 0.01 * level.knot_step_m < distance <= least + 1e-9
