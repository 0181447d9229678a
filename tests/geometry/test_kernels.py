"""The compiled kernels against numpy and scipy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.geometry.kernels import (
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
