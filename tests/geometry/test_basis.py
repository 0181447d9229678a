"""The basis functions against the recursion of eq. (1) and against scipy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from bsmap_cli.geometry.basis import MAX_DEGREE, MIN_DEGREE, basis_matrix
from bsmap_cli.geometry.kernels import basis_weights

DEGREES = range(MIN_DEGREE, MAX_DEGREE + 1)
CORNERS = [0.0, 5e-324, 1e-12, 0.5, np.nextafter(1.0, 0.0), 1.0]
fractions = st.one_of(st.sampled_from(CORNERS), st.floats(0.0, 1.0))


def recursion(j, degree, u):
    """Eq. (1) on integer knots, second denominator t_(j+r+1) - t_(j+1)."""
    if degree == 0:
        return float(j <= u < j + 1)
    left = (u - j) / degree * recursion(j, degree - 1, u)
    right = (j + degree + 1 - u) / degree * recursion(j + 1, degree - 1, u)
    return left + right


def weights_at(degree, f):
    weights = np.empty(degree + 1)
    basis_weights(basis_matrix(degree), f, weights)
    return weights


@pytest.mark.parametrize("degree", DEGREES)
@given(f=fractions)
@settings(max_examples=60, deadline=None)
def test_oracle_01_partition_of_unity_and_no_negative_weight(degree, f):
    weights = weights_at(degree, f)
    assert weights.sum() == pytest.approx(1.0, abs=1e-14)
    assert weights.min() >= -1e-15


@pytest.mark.parametrize("degree", DEGREES)
@given(f=st.floats(0.0, 1.0, exclude_max=True))
@settings(max_examples=40, deadline=None)
def test_eq_01_corrected_recursion(degree, f):
    # f + degree rounds: ask the recursion at the fraction that is left of it
    u = f + degree
    assert weights_at(degree, u - degree) == pytest.approx(
        [recursion(a, degree, min(u, np.nextafter(degree + 1.0, 0.0))) for a in range(degree + 1)],
        abs=1e-13,
    )


def test_cubic_closed_form():
    f = np.linspace(0.0, 1.0, 17)
    h = 1.0 - f
    sixfold = np.array([h**3, 3 * f**3 - 6 * f**2 + 4, 3 * h**3 - 6 * h**2 + 4, f**3])
    weights = np.array([weights_at(3, x) for x in f])
    assert 6.0 * weights == pytest.approx(sixfold.T, abs=1e-14)


@pytest.mark.parametrize("degree", DEGREES)
def test_matrix_equals_scipy_basis_elements(degree):
    f = np.linspace(0.0, 1.0, 9)
    for a in range(degree + 1):
        element = BSpline.basis_element(np.arange(degree + 2.0))
        expected = element(np.minimum(f + degree - a, degree + 1.0))
        assert [weights_at(degree, x)[a] for x in f] == pytest.approx(expected, abs=1e-13)


def test_the_shared_matrix_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        basis_matrix(3)[0, 0] = 1.0


def test_oracle_17_gram_band():
    """Integrals of products of cubic translates: 151/315, 397/1680, 1/42, 1/5040 (Delta = 1)."""
    matrix = basis_matrix(3)
    moments = 1.0 / (np.arange(4)[:, None] + np.arange(4)[None, :] + 1.0)
    on_one_span = matrix @ moments @ matrix.T
    band = [sum(on_one_span[a, a - k] for a in range(k, 4)) for k in range(4)]
    assert band == pytest.approx([151 / 315, 397 / 1680, 1 / 42, 1 / 5040], abs=1e-14)


def test_oracle_18_weights_of_all_data_add_up_to_their_number():
    random = np.random.default_rng(4)
    u = np.concatenate((random.uniform(0.0, 9.0, 200), np.arange(9.0)))
    total = np.zeros(12)
    for value in u:
        span = int(np.floor(value))
        total[span : span + 4] += weights_at(3, value - span)
    assert total.sum() == pytest.approx(len(u), abs=1e-11)
