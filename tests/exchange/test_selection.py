"""Clipping to a box and flattening within a tolerance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import KDTree

from bsmap_cli.exchange.bezier import bezier_pieces
from bsmap_cli.exchange.flatten import polylines, simplified
from bsmap_cli.exchange.selection import select, within_box
from bsmap_cli.mapping.sampling import evaluate, sample_level
from tests.exchange.exported import assert_same_lines, distances, drawn_lines, wavy_document


@given(
    st.floats(-14, -9), st.floats(32, 37), st.floats(0.05, 3), st.floats(0.05, 3), st.integers(2, 5)
)
@settings(deadline=None, max_examples=40)
def test_what_is_clipped_is_what_lies_in_the_box(x0, y0, width, height, degree):
    document = wavy_document(degree)
    box = (x0, y0, x0 + width, y0 + height)
    (whole,), (cut,) = select(document).levels, select(document, clip=box).levels
    level = whole.level

    def dense(pieces):
        rows = [
            evaluate(level, np.full(200, c), np.linspace(a, b, 200))[0]
            for c, a, b in zip(pieces.curve, pieces.start, pieces.end, strict=True)
        ]
        return np.concatenate([np.zeros((0, 2)), *rows])

    def depth(points):
        """How far inside the box, negative outside."""
        return np.minimum(points - box[:2], np.array(box[2:]) - points).min(axis=1)

    kept = dense(cut.pieces)
    assert (depth(kept) > -1e-9).all()
    inside = sample_level(level, 0.005).points
    inside = inside[depth(inside) > 0.003]  # what only grazes the border may fall between samples
    if len(inside):
        assert len(kept)
        assert KDTree(kept).query(inside)[0].max() < 0.03


def test_a_box_round_everything_changes_nothing():
    document = wavy_document()
    whole, cut = select(document).levels[0], select(document, clip=(-99, -99, 99, 99)).levels[0]
    for name in ("curve", "start", "end"):
        np.testing.assert_array_equal(getattr(cut.pieces, name), getattr(whole.pieces, name))


def test_a_box_beside_everything_leaves_nothing():
    (cut,) = select(wavy_document(), clip=(0, 0, 1, 1)).levels
    assert len(cut.pieces.curve) == 0
    assert polylines(cut) == bezier_pieces(cut) == []


def test_a_map_within_a_box_has_the_whole_curves_that_reach_into_it():
    document = wavy_document(levels=(0.2, 0.1))
    box = (-13.5, 32.9, -12.5, 33.5)  # the lower end of the straight
    for level, whole in zip(within_box(document, box).levels, document.levels, strict=True):
        assert len(level) == 1
        (row,) = np.flatnonzero(whole.curve_ids == level.curve_ids)
        begin, end = whole.offsets()[row : row + 2]
        np.testing.assert_array_equal(level.control_points, whole.control_points[begin:end])


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
@pytest.mark.parametrize("tolerance_m", [1e-4, 1e-3, 1e-2])
def test_polylines_keep_within_the_tolerance(degree, tolerance_m):
    (selected,) = select(wavy_document(degree)).levels
    lines = polylines(selected, tolerance_m)
    assert_same_lines(lines, selected.level, tolerance_m)
    assert len(lines) == len(selected.pieces.curve) == 4
    assert len(lines[-1]) == 2  # the straight one


def test_fewer_vertices_for_a_wider_tolerance():
    (selected,) = select(wavy_document()).levels
    counts = [sum(map(len, polylines(selected, t))) for t in (1e-4, 1e-3, 1e-2)]
    assert counts[0] > 2 * counts[1] > 4 * counts[2]


@given(st.integers(0, 1000), st.sampled_from([0.01, 0.1, 1.0]))
@settings(deadline=None)
def test_simplified_lines_keep_ends_and_miss_no_vertex_by_more_than_the_tolerance(seed, tolerance):
    line = np.cumsum(np.random.default_rng(seed).normal(0, 0.3, (30, 2)), axis=0)
    kept = simplified(line, tolerance)
    np.testing.assert_array_equal(kept[[0, -1]], line[[0, -1]])
    assert {tuple(p) for p in kept} <= {tuple(p) for p in line}
    assert distances(line, [kept]).max() <= tolerance + 1e-12


def test_a_closed_line_is_not_lost():
    angle = np.linspace(0, 2 * np.pi, 50)
    circle = np.column_stack((np.cos(angle), np.sin(angle)))
    circle[-1] = circle[0]
    assert len(simplified(circle, 0.01)) > 10


@pytest.mark.parametrize("degree", [2, 3])
def test_bezier_segments_are_the_spans_themselves(degree):
    (selected,) = select(wavy_document(degree)).levels
    pieces = selected.pieces
    t = np.linspace(0, 1, 9)
    basis = [[1, 2, 1], [1, 3, 3, 1]][degree - 2]
    weights = np.stack(
        [basis[j] * t**j * (1 - t) ** (degree - j) for j in range(degree + 1)], axis=1
    )
    for k, segments in enumerate(bezier_pieces(selected)):
        knots = np.unique(
            [pieces.start[k], *np.arange(np.ceil(pieces.start[k]), pieces.end[k]), pieces.end[k]]
        )
        assert len(segments) == len(knots) - 1
        for segment, a, b in zip(segments, knots[:-1], knots[1:], strict=True):
            u = a + (b - a) * t
            truth, _ = evaluate(selected.level, np.full(9, pieces.curve[k]), u)
            np.testing.assert_allclose(weights @ segment, truth, atol=1e-9)


@pytest.mark.parametrize("degree", [4, 5])
@pytest.mark.parametrize("step", [0.1, 0.4])
def test_cubics_follow_higher_degrees_within_a_tenth_of_a_millimetre(degree, step):
    (selected,) = select(wavy_document(degree, levels=(step,))).levels
    t = np.linspace(0, 1, 50)[:, None]
    truth = drawn_lines(selected.level)
    for segments in bezier_pieces(selected):
        for a, b, c, d in segments:
            points = (1 - t) ** 3 * a + 3 * t * (1 - t) ** 2 * b + 3 * t**2 * (1 - t) * c + t**3 * d
            assert distances(points, truth).max() < 1e-4
        np.testing.assert_allclose(segments[1:, 0], segments[:-1, -1], atol=1e-12)
