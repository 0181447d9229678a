"""Poses by time: exact where there is one, between neighbours, silent where there is none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsmap_cli.sensor.pose_track import NEAR_NS, WIDEST_GAP_NS, PoseTrack
from bsmap_cli.sensor.trajectory import Trajectory

HUGE_NS = 1_700_000_000_123_456_789  # a float would lose the last digits


def track(*rows):
    """A track of (stamp, x, y, yaw) rows."""
    stamps = np.array([row[0] for row in rows], np.int64)
    return PoseTrack(Trajectory(stamps, np.array([row[1:] for row in rows], float).reshape(-1, 3)))


def test_a_pose_at_the_very_stamp_is_given_unchanged():
    poses = track((HUGE_NS, 1, 2, 3), (HUGE_NS + 1, 4, 5, 1))
    assert poses.at(HUGE_NS).as_array() == pytest.approx([1, 2, 3], abs=0)
    assert poses.at(HUGE_NS + 1).as_array() == pytest.approx([4, 5, 1], abs=0)


def test_between_two_poses_the_way_is_straight_and_the_turn_is_the_short_one():
    poses = track((0, 0.0, 0.0, math.pi - 0.1), (100, 2.0, 4.0, -math.pi + 0.3))
    middle = poses.at(25)
    assert (middle.x, middle.y) == pytest.approx((0.5, 1.0))
    assert middle.theta == pytest.approx(math.pi)
    assert poses.at(50).theta == pytest.approx(-math.pi + 0.1)


def test_wide_gaps_are_not_bridged():
    poses = track((0, 0, 0, 0), (WIDEST_GAP_NS + 1, 9, 9, 1))
    assert poses.at(WIDEST_GAP_NS // 2) is None
    assert poses.at(NEAR_NS).x == 0.0
    assert poses.at(NEAR_NS + 1) is None
    assert poses.at(WIDEST_GAP_NS + 1 - NEAR_NS).x == 9.0


def test_beyond_the_ends_only_a_near_pose_will_do():
    poses = track((0, 1, 0, 0), (100, 2, 0, 0))
    assert poses.at(-NEAR_NS).x == 1.0
    assert poses.at(-NEAR_NS - 1) is None
    assert poses.at(100 + NEAR_NS).x == 2.0
    assert poses.at(101 + NEAR_NS) is None


def test_an_empty_trajectory_knows_nothing():
    assert track().at(0) is None


@given(st.lists(st.integers(0, 10**9), min_size=1, max_size=20), st.randoms(use_true_random=False))
def test_the_order_of_the_rows_does_not_matter(stamps, random):
    rows = [(stamp, stamp / 1e9, -stamp / 1e9, 0.0) for stamp in dict.fromkeys(stamps)]
    shuffled = list(rows)
    random.shuffle(shuffled)
    for probe in range(0, 10**9, 10**8 + 7):
        assert track(*rows).at(probe) == track(*shuffled).at(probe)


@given(st.integers(0, 10**9), st.integers(1, WIDEST_GAP_NS), st.floats(0, 1))
def test_motion_at_constant_speed_is_met_exactly(start, gap, share):
    probe = start + round(share * gap)
    pose = track((start, 0, 0, 0), (start + gap, gap / 1e9, 0, 0.5 * gap / 1e9)).at(probe)
    assert pose.x == pytest.approx((probe - start) / 1e9, abs=1e-12)
    assert pose.theta == pytest.approx(0.5 * (probe - start) / 1e9, abs=1e-12)
