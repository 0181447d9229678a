"""The compiled kernels against numpy and scipy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.geometry.kernels import (
    foot_point,
    polynomial_jet,
    solve3,
    solve_banded,
    span_polynomial,
    symmetric_eigen3,
)
from tests.geometry.curves import random_curves

seeds = st.integers(0, 2**32)


@given(random_curves(), st.floats(0.0, 1.0))
@settings(max_examples=60, deadline=None)
def test_jet_equals_the_curve_and_its_derivatives(curve, f):
    degree, step = curve.degree, curve.knot_step_m
    polynomial = np.empty((degree + 1, 2))
    row = curve.span_count - 1
    span_polynomial(curve.control_points, row, basis_matrix(degree), polynomial)
    jet = np.array(polynomial_jet(polynomial, f)).reshape(3, 2)
    tau = np.array([(curve.first_index + degree + row + f) * step])
    f_rounded = curve.locate(tau)[1][0]
    expected = [curve.evaluate(tau, order)[0] * step**order for order in range(3)]
    assert jet == pytest.approx(np.array(expected), abs=1e-9 + 100 * abs(f - f_rounded))


def gentle_curve(seed):
    """Control points along a winding line, so that a foot point is found from near it."""
    random = np.random.default_rng(seed)
    heading = np.cumsum(random.uniform(-0.25, 0.25, 14))
    return np.cumsum(np.column_stack((np.cos(heading), np.sin(heading))), axis=0)


@given(seeds, st.floats(0.0, 1.0), st.floats(-0.5, 0.5))
@settings(max_examples=80, deadline=None)
def test_oracle_19_foot_point_residual_is_perpendicular_and_nearest(seed, place, off):
    points, matrix = gentle_curve(seed), basis_matrix(3)
    polynomial = np.empty((4, 2))
    last = len(points) - 4
    u = place * (last + 1)
    row = min(int(u), last)
    span_polynomial(points, row, matrix, polynomial)
    x, y, dx, dy, _, _ = polynomial_jet(polynomial, u - row)
    speed = np.hypot(dx, dy)
    px, py = x - off * dy / speed, y + off * dx / speed
    # begin half a span away: that is where the span index may leave the search
    start = min(max(u + 0.5, 0.0), last + 1.0)
    begin = min(int(start), last)
    found, f = foot_point(points, matrix, begin, start - begin, 0, last, px, py, 20, polynomial)
    span_polynomial(points, found, matrix, polynomial)
    x, y, dx, dy, _, _ = polynomial_jet(polynomial, f)
    if 1e-9 < found + f < last + 1 - 1e-9:
        assert ((px - x) * dx + (py - y) * dy) / np.hypot(dx, dy) == pytest.approx(0.0, abs=1e-6)

    def distance(v):
        at = min(int(v), last)
        span_polynomial(points, at, matrix, polynomial)
        sx, sy, *_ = polynomial_jet(polynomial, v - at)
        return np.hypot(sx - px, sy - py)

    low, high = max(u - 1.0, 0.0), min(u + 1.0, last + 1.0)
    best = minimize_scalar(distance, bounds=(low, high), method="bounded").fun
    assert np.hypot(x - px, y - py) <= best + 1e-6


@given(seeds, st.floats(-3.0, 3.0))
@settings(max_examples=40, deadline=None)
def test_foot_point_stays_within_the_allowed_spans(seed, off):
    points, matrix, polynomial = gentle_curve(seed), basis_matrix(3), np.empty((4, 2))
    row, f = foot_point(points, matrix, 4, 0.5, 3, 5, off * 10.0, off, 8, polynomial)
    assert 3 <= row <= 5
    assert 0.0 <= f <= 1.0
    expected = np.empty((4, 2))
    span_polynomial(points, row, matrix, expected)
    assert np.array_equal(polynomial, expected)


@given(seeds, st.integers(1, 15), st.integers(1, 5))
@settings(max_examples=60, deadline=None)
def test_banded_cholesky_equals_the_dense_solution(seed, n, half_band):
    random = np.random.default_rng(seed)
    rows = random.normal(size=(n + half_band, n))
    i, j = np.indices(rows.shape)
    rows[(j > i) | (i > j + half_band)] = 0.0  # R^T R of a band matrix is banded
    dense = rows.T @ rows + 0.1 * np.eye(n)
    band = np.zeros((n, half_band + 1))
    for k in range(min(half_band + 1, n)):
        band[: n - k, k] = np.diag(dense, -k)
    right = random.normal(size=(n, 2))
    solution = right.copy()
    assert solve_banded(band, solution)
    assert solution == pytest.approx(np.linalg.solve(dense, right), rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("pivot", [0.0, -1.0, np.nan])
def test_banded_cholesky_refuses_what_is_not_positive_definite(pivot):
    assert not solve_banded(np.array([[1.0, 0.0], [pivot, 0.0]]), np.ones((2, 2)))


@given(seeds, st.sampled_from([0, 1, 2, 3]), st.floats(1e-3, 1e6))
@settings(max_examples=100, deadline=None)
def test_eigenvalues_equal_lapack(seed, rank, scale):
    """Rank-deficient ones above all: they are the corridors."""
    rows = np.random.default_rng(seed).normal(size=(rank, 3)) * scale
    matrix = rows.T @ rows
    values, vectors = np.empty(3), np.empty((3, 3))
    symmetric_eigen3(matrix, values, vectors)
    largest = max(np.abs(matrix).max(), 1e-300)
    assert values == pytest.approx(np.linalg.eigvalsh(matrix), abs=1e-11 * largest)
    assert vectors @ np.diag(values) @ vectors.T == pytest.approx(matrix, abs=1e-11 * largest)
    assert vectors.T @ vectors == pytest.approx(np.eye(3), abs=1e-12)


@given(seeds)
@settings(max_examples=60, deadline=None)
def test_three_unknowns_solved_as_by_numpy(seed):
    random = np.random.default_rng(seed)
    rows = random.normal(size=(5, 3))
    matrix, right, solution = rows.T @ rows + 0.01 * np.eye(3), random.normal(size=3), np.empty(3)
    solve3(matrix, right, solution)
    assert solution == pytest.approx(np.linalg.solve(matrix, right), rel=1e-8, abs=1e-8)
