"""Where curves are drawn, beside a walk over spans one at a time."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.mapping.sampling import drawn_pieces, evaluate, sample_level
from tests.maps import line_points, make_level


@st.composite
def levels(draw):
    degree = draw(st.integers(2, 5))
    counts = draw(st.lists(st.integers(degree + 1, degree + 8), min_size=1, max_size=4))
    seed = draw(st.integers(0, 1000))
    rng = np.random.default_rng(seed)
    curves = [np.cumsum(rng.normal(0.2, 0.1, (count, 2)), axis=0) for count in counts]
    # zeros are rare enough that spans survive between them
    weights = np.where(rng.random(sum(counts)) < 0.1, 0, rng.integers(1, 50, sum(counts)))
    firsts = rng.integers(-100, 100, len(counts))
    level = make_level(curves, 0.25, degree, weights, firsts)
    level.tau_start_m[:] += rng.uniform(-0.4, 0.7, len(counts)).astype(np.float32)
    level.tau_end_m[:] -= rng.uniform(-0.4, 0.7, len(counts)).astype(np.float32)
    return level


def naive_pieces(level):
    """Drawn parts as (curve, tau from, tau to), absolute [m]."""
    pieces = []
    for index, curve in enumerate(level):
        for span in range(curve.span_count):
            if 0 in curve.weights[span : span + level.degree + 1]:
                continue
            knot = (curve.first_index + level.degree + span) * curve.knot_step_m
            start, end = max(knot, curve.tau_start_m), min(knot + 0.25, curve.tau_end_m)
            if end - start < 1e-9:
                continue
            if pieces and pieces[-1][0] == index and abs(pieces[-1][2] - start) < 1e-9:
                start = pieces.pop()[1]
            pieces.append((index, start, end))
    return pieces


@given(levels())
@settings(deadline=None)
def test_pieces_are_the_spans_within_support_with_no_zero_weight(level):
    pieces = drawn_pieces(level)
    first = level.first_indices[pieces.curve] + level.degree
    taus = [(first + u) * 0.25 for u in (pieces.start, pieces.end)]
    found = list(zip(pieces.curve.tolist(), *(tau.tolist() for tau in taus), strict=True))
    expected = naive_pieces(level)
    assert [row[0] for row in found] == [row[0] for row in expected]
    np.testing.assert_allclose(np.reshape(found, (-1, 3)), np.reshape(expected, (-1, 3)), atol=1e-9)


@given(levels(), st.sampled_from([0.03, 0.0625, 1.0]))
@settings(deadline=None)
def test_samples_lie_on_the_curves(level, step_m):
    samples = sample_level(level, step_m)
    curves = list(level)
    for k, index in enumerate(samples.curve):
        curve, tau = curves[index], samples.tau_m[k : k + 1]
        np.testing.assert_allclose(samples.points[k], curve.evaluate(tau)[0], atol=1e-9)
        velocity = curve.evaluate(tau, 1)[0]
        np.testing.assert_allclose(samples.tangents[k] * np.hypot(*velocity), velocity, atol=1e-9)
        span, _ = curve.locate(tau)
        near = [curve.weights[s : s + level.degree + 1].mean() for s in range(span[0] + 1)]
        # on a knot the sample may count to either span
        assert min(abs(samples.weight[k] - w) for w in near[-2:]) < 1e-12 or span[0] == 0


@given(levels(), st.sampled_from([0.03, 0.0625, 1.0]))
@settings(deadline=None)
def test_pieces_are_sampled_from_end_to_end_in_even_steps(level, step_m):
    samples, pieces = sample_level(level, step_m), naive_pieces(level)
    assert len(np.unique(samples.piece)) == len(pieces)
    for number, (index, start, end) in enumerate(pieces):
        rows = samples.piece == number
        taus = samples.tau_m[rows]
        assert set(samples.curve[rows].tolist()) == {index}
        np.testing.assert_allclose(taus[[0, -1]], [start, end], atol=1e-9)
        steps = np.diff(taus)
        assert steps.min() > 0
        assert steps.max() <= step_m + 1e-6
        np.testing.assert_allclose(steps, steps[0], atol=1e-9)


def test_a_support_cut_to_the_knot_leaves_no_sliver():
    # 0.7 is a little more than seven tenths in float32
    level = make_level([line_points((0, 0), (1, 0), 0.1)])
    level.tau_end_m[:] = np.float32(0.7)
    level.weights[:] = [5] * 7 + [0, 0, 5, 5]
    pieces = drawn_pieces(level)
    assert len(pieces.curve) == 1
    assert pieces.end[0] == pytest.approx(4.0, abs=1e-6)


def test_an_empty_level_has_no_samples():
    samples = sample_level(make_level([]), 0.1)
    assert samples.points.shape == (0, 2)
    assert len(samples.tau_m) == 0


def test_evaluation_of_many_curves_at_once_on_a_line():
    level = make_level([line_points((0, 0), (1, 0), 0.1), line_points((0, 3), (0, 4), 0.1)])
    points, weight = evaluate(level, np.array([0, 1]), np.array([0.5, 8.0]))
    np.testing.assert_allclose(points, [[0.15, 0.0], [0.0, 3.9]], atol=1e-6)
    np.testing.assert_array_equal(weight, [5.0, 5.0])
