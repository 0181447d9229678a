"""From a message's numbers to a scan: direction, mirror, limits, float32."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import (
    canonical_yaw,
    float32_value,
    quaternion_of_yaw,
    yaw_of_quaternion,
)
from bsmap_cli.logs.laser import scan_of
from bsmap_cli.logs.messages import BadMessageError, LaserRecord
from bsmap_cli.logs.transforms import matrix_of, mounting_of

INF = math.inf


def record(ranges, low=-0.5, step=0.01, time_step=0.0, near=0.0, far=INF):
    return LaserRecord(5, "laser", low, step, time_step, near, far, np.float32(ranges))


def made(rec, pose=SE2.identity(), upside_down=False):  # noqa: B008
    return scan_of(
        rec,
        stamp_ns=5,
        topic="/scan",
        pose_base_laser=pose,
        upside_down=upside_down,
        pose_odom_base=None,
    )


def points_base(scan):
    angles = scan.angle_min_rad + np.arange(len(scan.ranges_m)) * scan.angle_increment_rad
    laser = scan.ranges_m[:, None] * np.stack((np.cos(angles), np.sin(angles)), axis=-1)
    return scan.pose_base_laser.transform(laser)


def in_order(points):
    return points[np.lexsort(np.round(points, 4).T)]


@given(
    low=st.floats(-math.pi, 0),
    step=st.floats(1e-3, 0.02),
    count=st.integers(2, 200),
    quaternion=st.tuples(*[st.floats(-1, 1)] * 2),
    clockwise=st.booleans(),
    turned_over=st.booleans(),
)
def test_points_are_where_a_rigid_motion_in_space_puts_them(
    low, step, count, quaternion, clockwise, turned_over
):
    """A level or hanging laser: beams by the oracle of a full rotation in space."""
    length = math.hypot(*quaternion)
    if length < 1e-3:
        return
    z, w = quaternion[0] / length, quaternion[1] / length
    turn = (w, z, 0.0, 0.0) if turned_over else (0.0, 0.0, z, w)
    matrix = matrix_of((0.3, -0.2, 0.1), turn)
    step = -step if clockwise else step
    ranges = np.linspace(1.0, 3.0, count)
    angles = low + np.arange(count) * step
    in_space = np.stack(
        (ranges * np.cos(angles), ranges * np.sin(angles), 0 * ranges, 1 + 0 * ranges)
    )
    expected = (matrix @ in_space)[:2].T
    mounting = mounting_of(matrix)
    assert mounting.upside_down == turned_over
    scan = made(record(ranges, low, step), mounting.pose_base_laser, mounting.upside_down)
    assert scan.angle_increment_rad > 0
    found = points_base(scan)
    if clockwise != turned_over:
        found = found[::-1]
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_clockwise_is_reversed():
    scan = made(record([1, 2, 3, 4], low=0.75, step=-0.25, time_step=1e-5))
    assert scan.ranges_m.tolist() == [4, 3, 2, 1]
    assert scan.angle_min_rad == 0.0
    assert scan.angle_increment_rad == 0.25
    assert scan.time_increment_s == -float32_value(1e-5)


@pytest.mark.parametrize(
    "bad",
    [
        record([]),
        record([1]),
        record([1, 2], low=math.nan),
        record([1, 2], step=0.0),
        record([1, 2], step=math.nan),
        record([1, 2], step=INF),
        record([1, 2], step=4.0),
        record([1] * 400, step=math.radians(1.0)),
        record([1, 2], low=1e30),
    ],
)
def test_what_is_no_scan(bad):
    with pytest.raises(BadMessageError):
        made(bad)


@pytest.mark.parametrize("count", [720, 721])
def test_a_full_turn_with_and_without_a_doubled_beam(count):
    scan = made(record([1] * count, low=-math.pi, step=math.tau / 720))
    assert len(scan.ranges_m) == count


@pytest.mark.parametrize("far", [0.0, -1.0, math.nan, INF])
def test_limits_that_state_nothing(far):
    scan = made(record([1, 2], near=math.nan, far=far))
    assert (scan.range_min_m, scan.range_max_m) == (0.0, INF)


def test_raw_ranges_are_kept():
    raw = [-INF, INF, math.nan, 0.0, 81.83, -1.0]
    np.testing.assert_array_equal(made(record(raw, far=30.0)).ranges_m, np.float32(raw))


@given(st.floats(-50, 50))
def test_a_yaw_survives_a_quaternion(yaw):
    there = canonical_yaw(yaw)
    back = canonical_yaw(yaw_of_quaternion(*quaternion_of_yaw(there)))
    assert back == there
    assert -math.pi < there <= math.pi
    assert abs(math.remainder(there - yaw, math.tau)) < 1e-8


@given(st.floats(width=32, allow_nan=False))
def test_float32_values_stay(value):
    assert float32_value(value) == value


def test_tilt_is_told():
    mounting = mounting_of(matrix_of((0, 0, 0), (0.0, math.sin(0.2), 0.0, math.cos(0.2))))
    assert mounting.is_tilted
    assert mounting.tilt_rad == pytest.approx(0.4)
    assert not mounting_of(np.eye(4)).is_tilted
