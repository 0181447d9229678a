"""Eqs. (6)-(11): fits on one lattice, and the offset between them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.mapping.alignment import AlignmentSettings, align_offset
from bsmap_cli.mapping.fitting import FittingSettings, fit_curve

PAPER = FittingSettings(parameters="chord", penalty=0.0)
STEP = 0.2


def bumpy(start=0.0, end=5.0, spacing=0.01):
    """Points on a wall with bumps, by arc length from `start` to `end` of it."""
    x = np.arange(0.0, 6.0, 1e-4)
    y = 0.25 * np.sin(2.0 * x) + 0.1 * np.sin(5.0 * x + 1.0)
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))
    at = np.arange(start, end, spacing)
    return np.column_stack((np.interp(at, arc, x), np.interp(at, arc, y)))


def fit(points, start_m, degree=3):
    return fit_curve(points, PAPER, knot_step_m=STEP, degree=degree, start_m=start_m)


def test_eq_11_sign():
    """The scan begins at 1.5 m of the map curve; from a guess of 1.3 m, +0.2 m is to be added."""
    map_curve = fit(bumpy(), 0.0)
    scan_curve = fit(bumpy(1.5, 4.0), 1.3)
    one = align_offset(map_curve, scan_curve, AlignmentSettings(iterations=1))
    two = align_offset(map_curve, scan_curve, AlignmentSettings(iterations=2))
    assert one == pytest.approx(0.2, abs=0.05)
    assert two == pytest.approx(0.2, abs=3e-3)
    many = align_offset(map_curve, scan_curve, AlignmentSettings(iterations=20))
    assert many == pytest.approx(0.2, abs=5e-4)


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
@pytest.mark.parametrize("guess", [-0.5, -0.1, 0.13, 0.5])
def test_the_offset_is_recovered(degree, guess):
    map_curve = fit(bumpy(), 0.0, degree)
    scan_curve = fit(bumpy(1.5, 4.0), 1.5 + guess, degree)
    found = align_offset(map_curve, scan_curve, AlignmentSettings(iterations=20))
    assert found == pytest.approx(-guess, abs=1e-3)


def test_eq_11_is_the_minimiser_of_the_linearised_error_with_the_other_sign():
    """(10) is least at the argument shift; (11) is its negative, the offset."""
    map_curve, scan_curve = fit(bumpy(), 0.0), fit(bumpy(1.5, 4.0), 1.45)
    r = 20
    low, high = scan_curve.tau_start_m, scan_curve.tau_end_m
    tau = low + (high - low) * (np.arange(r) + 0.5) / r
    error = map_curve.evaluate(tau) - scan_curve.evaluate(tau)
    slope = scan_curve.evaluate(tau, 1)
    shifts = np.linspace(-0.2, 0.2, 4001)
    cost = [np.sum((error - slope * shift) ** 2) for shift in shifts]  # (10)
    best = shifts[int(np.argmin(cost))]
    found = align_offset(map_curve, scan_curve, AlignmentSettings(samples=r, iterations=1))
    assert found == pytest.approx(-best, abs=1e-4)


def test_on_a_straight_wall_one_step_is_exact():
    """Unit speed and a known pose make tau observable even there."""
    x = np.arange(0.0, 5.0, 0.01)
    wall = np.column_stack((x, np.zeros_like(x)))
    map_curve, scan_curve = fit(wall, 0.0), fit(wall[120:400], 1.0)
    one = align_offset(map_curve, scan_curve, AlignmentSettings(iterations=1))
    assert one == pytest.approx(0.2, abs=1e-6)


def test_curves_without_a_common_part_have_no_offset():
    map_curve, scan_curve = fit(bumpy(0.0, 2.0), 0.0), fit(bumpy(2.5, 4.0), 2.5)
    assert align_offset(map_curve, scan_curve, AlignmentSettings()) is None


@given(k=st.integers(-50, 50), phase=st.floats(0.0, 0.999), degree=st.integers(2, 5))
@settings(max_examples=40, deadline=None)
def test_a_shift_by_whole_knot_steps_is_exact(k, phase, degree):
    points = bumpy(0.7, 3.1)
    here = fit(points, phase * STEP, degree)
    there = fit(points, (phase + k) * STEP, degree)
    assert there.first_index - here.first_index == k
    # the ends are badly conditioned, the curve itself is not
    tau = np.linspace(here.tau_start_m, here.tau_end_m, 200)
    np.testing.assert_allclose(there.evaluate(tau + k * STEP), here.evaluate(tau), atol=1e-7)


def test_a_shift_by_half_a_knot_step_is_not():
    points = bumpy(0.7, 3.1)
    here, there = fit(points, 0.0), fit(points, 0.5 * STEP)
    tau = np.linspace(here.tau_start_m, here.tau_end_m, 200)
    away = np.abs(there.evaluate(tau + 0.5 * STEP) - here.evaluate(tau)).max()
    assert 1e-5 < away < 5e-3


def test_the_plain_fit_is_defined_where_the_normal_equations_are_singular():
    """gamma_abs = 0.7 Delta does not make eq. (8) regular: Schoenberg-Whitney does."""
    x = np.arange(0.0, 3.0, 0.99 * STEP)
    fitted = fit(np.column_stack((x, 0.1 * x**2)), 0.05)
    assert np.all(np.isfinite(fitted.control_points))
    tau = fitted.tau_start_m + np.concatenate(
        ([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(0.1 * x**2))))
    )
    np.testing.assert_allclose(fitted.evaluate(tau)[:, 0], x, atol=1e-3)
