"""Curves against scipy, and the laws that hold for every one of them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from bsmap_cli.geometry.curve import Curve
from bsmap_cli.geometry.se2 import SE2
from tests.geometry.curves import inner_parameters, random_curves


def scipy_spline(curve):
    count = len(curve.control_points) + curve.degree + 1
    knots = (curve.first_index + np.arange(count)) * curve.knot_step_m
    return BSpline(knots, curve.control_points, curve.degree)


@given(random_curves())
@settings(max_examples=80, deadline=None)
def test_oracle_02_evaluation_equals_scipy(curve):
    tau = inner_parameters(curve)
    assert curve.evaluate(tau) == pytest.approx(scipy_spline(curve)(tau), abs=1e-10)


@given(random_curves())
@settings(max_examples=80, deadline=None)
def test_oracle_03_derivative_equals_scipy(curve):
    # a derivative of the highest order jumps at the knots: stay inside the spans
    u = np.arange(curve.span_count)[:, None] + np.array([0.1, 0.37, 0.5, 0.93])
    tau = (curve.first_index + curve.degree + u.ravel()) * curve.knot_step_m
    for order in range(1, curve.degree + 1):
        expected = scipy_spline(curve).derivative(order)(tau)
        scale = curve.knot_step_m**-order
        assert curve.evaluate(tau, order) == pytest.approx(expected, abs=1e-8 * scale)


@given(random_curves(), st.floats(-50, 50), st.floats(-50, 50), st.floats(-math.pi, math.pi))
@settings(max_examples=60, deadline=None)
def test_oracle_05_evaluation_commutes_with_rigid_motion(curve, x, y, theta):
    pose, tau = SE2(x, y, theta), inner_parameters(curve)
    moved = replace(curve, control_points=pose.transform(curve.control_points)).evaluate(tau)
    assert moved == pytest.approx(pose.transform(curve.evaluate(tau)), abs=1e-12 * (60 + abs(x)))


@given(random_curves(degree=3))
@settings(max_examples=40, deadline=None)
def test_oracle_16_span_lies_inside_the_box_of_its_control_points(curve):
    for span in range(curve.span_count):
        u = curve.first_index + curve.degree + span + np.linspace(0.0, 1.0, 9)
        points = curve.evaluate(u * curve.knot_step_m)
        active = curve.control_points[span : span + curve.degree + 1]
        assert np.all(points >= active.min(axis=0) - 1e-12)
        assert np.all(points <= active.max(axis=0) + 1e-12)


@given(random_curves())
@settings(max_examples=40, deadline=None)
def test_oracle_08_reversed_control_points_run_the_curve_backwards(curve):
    d, n = curve.degree, len(curve.control_points)
    # g -> -g - (d + 1): the last index becomes the first
    back = Curve(
        degree=d,
        knot_step_m=curve.knot_step_m,
        first_index=-(curve.first_index + n - 1) - (d + 1),
        control_points=curve.control_points[::-1],
        weights=curve.weights,
        tau_start_m=-curve.tau_end_m,
        tau_end_m=-curve.tau_start_m,
    )
    tau = inner_parameters(curve)
    assert back.evaluate(-tau) == pytest.approx(curve.evaluate(tau), abs=1e-8)


@given(random_curves(degree=3))
@settings(max_examples=40, deadline=None)
def test_oracle_15_dyadic_refinement_is_exact(curve):
    """Mask (1, 4, 6, 4, 1) / 8 on a lattice of half the step: I' = 2 I + 3, N' = 2 N - 3."""
    n = len(curve.control_points)
    upsampled = np.zeros((2 * n + 3, 2))
    for mask, shift in zip((1, 4, 6, 4, 1), range(5), strict=True):
        upsampled[shift : shift + 2 * n : 2] += mask / 8.0 * curve.control_points
    fine = Curve(
        degree=3,
        knot_step_m=curve.knot_step_m / 2.0,
        first_index=2 * curve.first_index + 3,
        control_points=upsampled[3 : 2 * n],
        weights=np.ones(2 * n - 3),
        tau_start_m=curve.tau_start_m,
        tau_end_m=curve.tau_end_m,
    )
    tau = inner_parameters(curve)
    assert fine.evaluate(tau) == pytest.approx(curve.evaluate(tau), abs=1e-11)


@given(st.integers(2, 5), st.integers(-50, 50), st.floats(0.01, 5.0), st.floats(-3.1, 3.1))
@settings(max_examples=40, deadline=None)
def test_oracle_09_linear_precision_at_greville_abscissae(degree, first, step, angle):
    """c_(g+1) - c_g = Delta t is the line of unit speed through the Greville points."""
    along = np.array([math.cos(angle), math.sin(angle)])
    greville = (first + np.arange(degree + 4) + (degree + 1) / 2.0) * step
    curve = Curve(
        degree=degree,
        knot_step_m=step,
        first_index=first,
        control_points=greville[:, None] * along,
        weights=np.ones(degree + 4),
        tau_start_m=(first + degree) * step,
        tau_end_m=(first + degree + 4) * step,
    )
    tau = inner_parameters(curve)
    scale = step * (abs(first) + 10)
    assert curve.evaluate(tau) == pytest.approx(tau[:, None] * along, abs=1e-12 * scale)
    speed = np.hypot(*curve.evaluate(tau, 1).T)
    assert speed == pytest.approx(np.ones(len(tau)), abs=1e-10)


def test_parameters_beyond_the_domain_are_clamped_and_its_right_end_is_closed():
    curve = Curve(
        degree=3,
        knot_step_m=0.1,
        first_index=0,
        control_points=np.column_stack((np.arange(6.0), np.arange(6.0) ** 2)),
        weights=np.ones(6),
        tau_start_m=0.3,
        tau_end_m=0.6,
    )
    assert curve.evaluate([-1.0, 0.3]) == pytest.approx(curve.evaluate([0.3, 0.3]))
    end = curve.control_points[3:] * np.array([[1], [4], [1]]) / 6.0
    assert curve.evaluate([0.6, 9.0]) == pytest.approx(np.tile(end.sum(axis=0), (2, 1)))
