"""Spans and foot points for compiled code against the curve itself and a numeric minimum."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.geometry.foot_points import foot_point, span_jet
from tests.geometry.curves import random_curves

seeds = st.integers(0, 2**32)


@given(random_curves(), st.floats(0.0, 1.0))
@settings(max_examples=60, deadline=None)
def test_jet_equals_the_curve_and_its_derivatives(curve, f):
    degree, step = curve.degree, curve.knot_step_m
    row = curve.span_count - 1
    jet = span_jet(curve.control_points, row, basis_matrix(degree), f)
    tau = np.array([(curve.first_index + degree + row + f) * step])
    f_rounded = curve.locate(tau)[1][0]
    expected = [curve.evaluate(tau, order)[0] * step**order for order in range(3)]
    assert np.reshape(jet, (3, 2)) == pytest.approx(
        np.array(expected), abs=1e-9 + 100 * abs(f - f_rounded)
    )


def gentle_curve(seed):
    """Control points along a winding line, so that a foot point is found from near it."""
    random = np.random.default_rng(seed)
    heading = np.cumsum(random.uniform(-0.25, 0.25, 14))
    return np.cumsum(np.column_stack((np.cos(heading), np.sin(heading))), axis=0)


@given(seeds, st.floats(0.0, 1.0), st.floats(-0.5, 0.5))
@settings(max_examples=80, deadline=None)
def test_oracle_19_foot_point_residual_is_perpendicular_and_nearest(seed, place, off):
    points, matrix = gentle_curve(seed), basis_matrix(3)
    last = len(points) - 4
    u = place * (last + 1)
    row = min(int(u), last)
    at = span_jet(points, row, matrix, u - row)
    speed = np.hypot(at.dx, at.dy)
    px, py = at.x - off * at.dy / speed, at.y + off * at.dx / speed
    # begin half a span away: that is where the span index may leave the search
    start = min(max(u + 0.5, 0.0), last + 1.0)
    begin = min(int(start), last)
    jet = span_jet(points, begin, matrix, start - begin)
    found, f, foot = foot_point(
        points, matrix, begin, start - begin, jet, 0, last, px, py, 20, 1e-7
    )
    assert foot == span_jet(points, found, matrix, f)
    if 1e-9 < found + f < last + 1 - 1e-9:
        along = (px - foot.x) * foot.dx + (py - foot.y) * foot.dy
        assert along / np.hypot(foot.dx, foot.dy) == pytest.approx(0.0, abs=1e-6)

    def distance(v):
        span = min(int(v), last)
        there = span_jet(points, span, matrix, v - span)
        return np.hypot(there.x - px, there.y - py)

    low, high = max(u - 1.0, 0.0), min(u + 1.0, last + 1.0)
    best = minimize_scalar(distance, bounds=(low, high), method="bounded").fun
    assert np.hypot(foot.x - px, foot.y - py) <= best + 1e-6


@given(seeds, st.floats(-3.0, 3.0))
@settings(max_examples=40, deadline=None)
def test_foot_point_stays_within_the_allowed_spans(seed, off):
    points, matrix = gentle_curve(seed), basis_matrix(3)
    jet = span_jet(points, 4, matrix, 0.5)
    row, f, foot = foot_point(points, matrix, 4, 0.5, jet, 3, 5, off * 10.0, off, 8, 1e-9)
    assert 3 <= row <= 5
    assert 0.0 <= f <= 1.0
    assert foot == span_jet(points, row, matrix, f)
