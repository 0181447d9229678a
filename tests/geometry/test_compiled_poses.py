"""Poses of compiled code against those of Python."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsmap_cli.geometry.compiled_poses import composed, relative, wrapped
from bsmap_cli.geometry.se2 import SE2, wrap_angle

metres = st.floats(-1e3, 1e3)
poses = st.builds(SE2, metres, metres, st.floats(-math.pi, math.pi).filter(lambda a: a > -math.pi))


def near(pose):
    """The same place, whichever side of pi a heading next to it is on."""
    return pytest.approx((pose.x, pose.y, math.cos(pose.theta), math.sin(pose.theta)), abs=1e-9)


def spelled(pose):
    x, y, theta = pose
    assert -math.pi <= theta <= math.pi
    return x, y, math.cos(theta), math.sin(theta)


@given(poses, poses)
def test_poses_are_composed(first, second):
    assert spelled(composed(tuple(first), tuple(second))) == near(first @ second)


@given(poses, poses)
def test_a_pose_is_seen_from_another(pose, origin):
    assert spelled(relative(tuple(pose), tuple(origin))) == near(pose.relative_to(origin))


@pytest.mark.parametrize("turns", [-2, -1, 0, 1, 2])
@pytest.mark.parametrize("angle", [-3.0, -1.0, 0.0, 1.0, 3.0, math.pi])
def test_an_angle_keeps_its_direction(angle, turns):
    assert wrapped(angle + turns * math.tau) == pytest.approx(wrap_angle(angle), abs=1e-12)
