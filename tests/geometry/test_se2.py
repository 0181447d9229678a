"""Rigid motions: the axioms of a group, next to the identity and at half turns too."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.geometry.se2 import SE2, wrap_angle

angles = st.one_of(
    st.sampled_from([0.0, math.pi, -math.pi, math.pi / 2, 1e-300, math.nextafter(math.pi, 4.0)]),
    st.floats(-20.0, 20.0),
)
metres = st.one_of(st.sampled_from([0.0, 1e-12]), st.floats(-1e3, 1e3))
poses = st.builds(lambda x, y, a: SE2(x, y, wrap_angle(a)), metres, metres, angles)


def matrix(pose):
    """The homogeneous matrix: a naive oracle for all of SE2."""
    c, s = math.cos(pose.theta), math.sin(pose.theta)
    return np.array([[c, -s, pose.x], [s, c, pose.y], [0.0, 0.0, 1.0]])


@given(angles)
@settings(max_examples=200, deadline=None)
def test_wrapped_angles_keep_their_direction_and_interval(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-12)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-12)


@given(poses, poses)
@settings(max_examples=100, deadline=None)
def test_composition_is_the_product_of_matrices(a, b):
    assert matrix(a @ b) == pytest.approx(matrix(a) @ matrix(b), abs=1e-9)
    assert -math.pi < (a @ b).theta <= math.pi


@given(poses)
@settings(max_examples=100, deadline=None)
def test_the_inverse_undoes(a):
    assert matrix(a.inverse() @ a) == pytest.approx(np.eye(3), abs=1e-9)
    assert matrix(a @ a.inverse()) == pytest.approx(np.eye(3), abs=1e-9)
    assert a @ SE2.identity() == a


@given(poses, poses, poses)
@settings(max_examples=50, deadline=None)
def test_composition_is_associative(a, b, c):
    assert matrix((a @ b) @ c) == pytest.approx(matrix(a @ (b @ c)), abs=1e-8)


@given(poses, st.lists(st.tuples(metres, metres), max_size=4))
@settings(max_examples=50, deadline=None)
def test_eq_02_transform_of_points(pose, rows):
    points = np.array(rows, float).reshape(-1, 2)
    homogeneous = np.column_stack((points, np.ones(len(points))))
    expected = (homogeneous @ matrix(pose).T)[:, :2]
    assert pose.transform(points) == pytest.approx(expected, abs=1e-9)


def test_array_and_back():
    pose = SE2.from_array([1.0, -2.0, 3.0 * math.pi])
    assert pose.theta == pytest.approx(math.pi)
    assert SE2.from_array(pose.as_array()) == pose
