import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.motion import Motion, MotionLimits, Route
from bsmap_cli.sensor.simulator.path import bend_pieces, join, through

STEP_S = 1e-3


def rates(motion, step_s=STEP_S):
    """Speed along the heading, speed across, turn rate, and their changes, by differences."""
    times = np.arange(0.0, motion.duration_s, step_s)
    before, after = motion.poses(times - step_s / 2), motion.poses(times + step_s / 2)
    heading = motion.poses(times)[:, 2]
    moved = (after - before) / step_s
    ahead = moved[:, 0] * np.cos(heading) + moved[:, 1] * np.sin(heading)
    aside = moved[:, 1] * np.cos(heading) - moved[:, 0] * np.sin(heading)
    changes = np.diff(ahead) / step_s, np.diff(moved[:, 2]) / step_s
    return ahead, aside, moved[:, 2], *changes


def assert_within(motion, limits):
    ahead, aside, turning, gaining, swerving = rates(motion)
    assert ahead.min() > -1e-6 and ahead.max() < limits.speed_m_s + 1e-6
    assert np.abs(aside).max() < 1e-4  # wheels do not slide
    assert np.abs(turning).max() < limits.turn_rate_rad_s + 1e-6
    assert np.abs(gaining).max() < limits.acceleration_m_s2 + 1e-3
    bending = limits.acceleration_m_s2 / limits.bend_radius_m  # where speed changes in a bend
    assert np.abs(swerving).max() < limits.turn_acceleration_rad_s2 + bending + 1e-3


@settings(max_examples=25, deadline=None)
@given(
    st.lists(st.tuples(st.floats(5.0, 9.0), st.floats(-2.3, 2.3)), min_size=1, max_size=5),
    st.floats(0.2, 1.2),
    st.floats(0.5, 1.0),
)
def test_a_drive_keeps_the_limits_and_arrives(steps, speed, radius):
    waypoints, heading = [np.array([1.0, -2.0])], 0.4
    for length, turn in steps:
        waypoints.append(waypoints[-1] + length * np.array([math.cos(heading), math.sin(heading)]))
        heading += turn
    limits = MotionLimits(speed_m_s=speed, bend_radius_m=radius)
    motion = Route(SE2(1.0, -2.0, 0.4), limits).drive(*waypoints[1:]).motion()
    assert_within(motion, limits)
    first, last = motion.poses(np.array([0.0, motion.duration_s + 5.0]))
    assert first == pytest.approx([1.0, -2.0, 0.4], abs=1e-12)
    assert last[:2] == pytest.approx(waypoints[-1], abs=1e-9)


def test_bends_cut_corners_and_touch_both_sides():
    path = through(np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 5.0]]), 1.0, 2.0)
    poses = path.poses(np.linspace(0.0, path.length_m, 2001))
    assert poses[-1] == pytest.approx([5.0, 5.0, math.pi / 2], abs=1e-9)
    assert path.length_m < 10.0
    assert 0.3 < np.hypot(*(poses[:, :2] - (5.0, 0.0)).T).min() < 0.8
    middle = poses[np.abs(poses[:, 0] - 5.0 + poses[:, 1]).argmin()]
    assert middle[2] == pytest.approx(math.pi / 4, abs=1e-2)  # symmetric about the corner


@given(st.floats(-3.0, 3.0).filter(lambda turn: abs(turn) > 1e-3), st.floats(0.1, 3.0))
def test_a_bend_turns_by_what_it_should(turn, sharpness):
    bend = join(bend_pieces(turn, 1.2, sharpness), np.zeros(3))
    assert bend.poses(np.array([bend.length_m]))[0, 2] == pytest.approx(turn, abs=1e-9)
    headings = bend.poses(np.linspace(0.0, bend.length_m, 400))[:, 2]
    curvature = np.diff(headings) / (bend.length_m / 399)
    assert np.abs(curvature).max() < 1.2 + 1e-9
    assert np.abs(np.diff(curvature)).max() / (bend.length_m / 399) < sharpness * 1.001 + 1e-6


def test_a_clothoid_is_integrated_exactly():
    """Positions against small straight steps in the direction of the middle heading."""
    bend = join(bend_pieces(2.5, 1.0, 0.5), np.array([1.0, 2.0, 0.7]))
    lengths = np.linspace(0.0, bend.length_m, 20_001)
    headings = bend.poses((lengths[1:] + lengths[:-1]) / 2)[:, 2]
    steps = np.stack((np.cos(headings), np.sin(headings)), axis=-1) * np.diff(lengths)[:, None]
    positions = np.array([1.0, 2.0]) + np.cumsum(steps, axis=0)
    assert bend.poses(lengths[1:])[:, :2] == pytest.approx(positions, abs=1e-8)


def test_waypoints_too_close_for_the_bend_are_refused():
    with pytest.raises(ValueError, match="waypoints 1 and 2 leave no room"):
        through(np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 0.5], [0.0, 0.5]]), 1.0, 2.0)


def test_turns_waits_and_drives_follow_one_another():
    route = Route(SE2(0.0, 0.0, 0.0), MotionLimits(speed_m_s=0.5))
    motion = route.turn(400.0).wait(2.0).drive((0.0, 3.0)).motion()
    assert_within(motion, MotionLimits(speed_m_s=0.5))
    poses = motion.poses(np.linspace(0.0, motion.duration_s, 500))
    assert np.degrees(poses[:, 2].max()) == pytest.approx(450.0)
    assert poses[-1, :2] == pytest.approx([0.0, 3.0], abs=1e-9)
    spin, wait, face, drive = motion.legs
    assert wait.duration_s == 2.0
    resting = motion.poses(spin.duration_s + np.linspace(0.0, 2.0, 9))
    assert np.ptp(resting, axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert math.degrees(face.angle_rad) == pytest.approx(50.0)
    assert drive.duration_s == pytest.approx(3.0 / 0.5 + 0.5 / 0.5)


def test_a_motion_rests_before_and_after():
    motion = Route(SE2(1.0, 0.0, 0.0)).drive((2.0, 0.0)).motion()
    assert isinstance(motion, Motion)
    before, after = motion.poses(np.array([-3.0, 1e6]))
    assert before.tolist() == [1.0, 0.0, 0.0]
    assert after == pytest.approx([2.0, 0.0, 0.0])
