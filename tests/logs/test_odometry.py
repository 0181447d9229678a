"""Motion: interpolated at the scan's stamp, from a topic or from the tree of frames."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsmap_cli.errors import BsmapError, UsageError
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.odometry import OdometryBuffer
from tests.logs.making import ODOM, SCAN, SECOND_NS, TF, Ros, planar, read, ros_mcap, some_scans

ROS = Ros()
T0 = 1_500_000_000 * SECOND_NS
MS = 1_000_000


def curve(t_ns):
    """A smooth drive that passes the seam of the angles."""
    t = (t_ns - T0) / SECOND_NS
    return SE2.from_array((0.5 * t, 0.1 * t * t, 0.9 * t))


def drive(tmp_path, messages, **options):
    path = tmp_path / "log.mcap"
    path.write_bytes(ros_mcap(messages, ROS))
    return read(path, **options)


def scan_at(stamp_ns, log_ns=None, topic="/scan", **fields):
    (scan,) = some_scans(1, 21, odometry=False)
    log_ns = stamp_ns if log_ns is None else log_ns
    return topic, SCAN, log_ns, ROS.scan(scan, stamp_ns=stamp_ns, **fields)


def odom_at(stamp_ns, log_ns=None, topic="/odom", pose=None, **fields):
    pose = pose or curve(stamp_ns)
    return topic, ODOM, log_ns or stamp_ns, ROS.odometry(stamp_ns, pose, **fields)


def tf_at(*transforms, topic="/tf"):
    return topic, TF, transforms[0][0], ROS.transforms(*transforms)


@given(st.lists(st.integers(1, 10**9), min_size=2, max_size=20), st.data())
def test_interpolation_is_that_of_numpy(steps, data):
    stamps = np.cumsum(steps).tolist()
    buffer = OdometryBuffer()
    for stamp in stamps:
        pose = curve(T0 + stamp)
        buffer.push(stamp, pose.x, pose.y, pose.theta)
    at = data.draw(st.integers(stamps[0], stamps[-1]))
    poses = np.array([curve(T0 + s).as_array() for s in stamps])
    poses[:, 2] = np.unwrap(poses[:, 2])
    found = buffer.interpolated(at)
    for axis, value in enumerate((found.x, found.y)):
        assert value == pytest.approx(np.interp(at, stamps, poses[:, axis]), abs=1e-9)
    turn = found.theta - np.interp(at, stamps, poses[:, 2])
    assert abs(math.remainder(turn, math.tau)) < 2e-9


def test_ends_hold_for_a_second():
    buffer = OdometryBuffer()
    assert buffer.interpolated(0) is None
    buffer.push(10 * SECOND_NS, 1.0, 2.0, 0.5)
    buffer.push(11 * SECOND_NS, 2.0, 2.0, 0.5)
    assert buffer.interpolated(9 * SECOND_NS).x == 1.0
    assert buffer.interpolated(12 * SECOND_NS).x == 2.0
    assert buffer.interpolated(9 * SECOND_NS - 1) is None
    assert buffer.interpolated(12 * SECOND_NS + 1) is None


def test_stamps_that_step_back_are_never_divided_by():
    buffer = OdometryBuffer()
    for stamp, x in ((100, 1.0), (200, 2.0), (200, 3.0), (150, 4.0), (160, 5.0)):
        buffer.push(stamp, x, 0.0, 0.0)
    assert buffer.interpolated(155).x == 4.5
    assert buffer.interpolated(200).x == 3.0
    assert buffer.interpolated(130).x == pytest.approx(1.3)


def test_memory_of_the_buffer_is_bounded():
    buffer = OdometryBuffer()
    for stamp in range(20_000):
        buffer.push(stamp, 0.0, 0.0, 0.0)
    assert buffer.at(19_999) is not None
    assert buffer.at(0) is None


@pytest.mark.parametrize("late", [0, 300])
def test_odometry_after_its_scan_in_the_log(tmp_path, late):
    """Receive times say nothing: a scan waits for the pose behind it, for a while."""
    messages = [odom_at(T0)]
    stamps = [T0 + (25 + 50 * i) * MS for i in range(40)]
    for stamp in stamps:
        messages.append(scan_at(stamp))
        messages.append(odom_at(stamp + 25 * MS, stamp + late * MS + 25 * MS))
    messages.sort(key=lambda message: message[2])
    found, report = drive(tmp_path, messages)
    assert [scan.stamp_ns for scan in found] == stamps
    assert report.odometry == "/odom"
    for scan in found:
        expected = curve(scan.stamp_ns)
        assert scan.pose_odom_base.x == pytest.approx(expected.x, abs=1e-6)
        assert scan.pose_odom_base.y == pytest.approx(expected.y, abs=1e-4)


def test_odometry_that_falls_silent(tmp_path):
    messages = [odom_at(T0 + i * 100 * MS) for i in range(20)]
    messages += [scan_at(T0 + i * 100 * MS) for i in range(60)]
    messages.sort(key=lambda message: message[2])
    found, report = drive(tmp_path, messages)
    assert len(found) == 60
    assert found[19].pose_odom_base is not None
    assert found[40].pose_odom_base is None
    assert any("no odometry (/odom)" in warning for warning in report.warnings)


def test_backward_and_repeated_stamps_keep_the_order_of_the_log(tmp_path):
    stamps = [T0, T0 + 50 * MS, T0 + 20 * MS, T0 + 20 * MS, T0 - 3600 * SECOND_NS, T0 + 90 * MS]
    messages = []
    for i, stamp in enumerate(stamps):
        log_ns = T0 + 50 * i * MS
        messages += [odom_at(stamp, log_ns, pose=SE2(float(i), 0.0, 0.0)), scan_at(stamp, log_ns)]
    found, _ = drive(tmp_path, messages)
    assert [scan.stamp_ns for scan in found] == stamps
    assert [scan.pose_odom_base.x for scan in found] == [0, 1, 2, 3, 4, 5]


def test_transforms_as_motion(tmp_path):
    messages = [
        tf_at(planar(T0, "base_link", "laser", SE2(0.2, 0.1, 0.3)), topic="/tf_static"),
        tf_at(planar(T0, "map", "odom", SE2(7.0, 7.0, 1.0))),
    ]
    for i in range(40):
        stamp = T0 + 50 * i * MS
        joint = planar(stamp, "base_link", "wheel", SE2(0.0, 0.0, 0.1 * i))
        messages.append(tf_at(planar(stamp, "odom", "base_link", curve(stamp)), joint))
        messages.append(scan_at(stamp + 10 * MS))
        messages.append(tf_at(planar(stamp, "map", "odom", SE2(float(i), 7.0, 1.0))))
    for options in ({}, {"odom": "tf"}, {"odom": "tf", "base_frame": "base_link"}):
        found, report = drive(tmp_path, messages, **options)
        assert report.odometry == "tf odom -> base_link"
        assert report.warnings == []
        for scan in found[:-1]:
            expected = curve(scan.stamp_ns)
            assert scan.pose_odom_base.x == pytest.approx(expected.x, abs=1e-3)
            assert abs(math.remainder(scan.pose_odom_base.theta - expected.theta, math.tau)) < 1e-3
            assert scan.pose_base_laser.x == pytest.approx(0.2)


def test_a_base_below_the_frame_of_the_odometry(tmp_path):
    """odom -> base_footprint moves, base_footprint -> base_link stands: both count."""
    static = planar(T0, "base_footprint", "base_link", SE2(0.5, 0.0, 0.0))
    laser = planar(T0, "base_link", "laser", SE2(0.1, 0.0, 0.0))
    messages = [tf_at(static, laser, topic="/tf_static")]
    for i in range(5):
        stamp = T0 + i * 50 * MS
        pose = SE2(float(i), 0.0, math.pi / 2)
        messages.append(tf_at(planar(stamp, "odom", "base_footprint", pose)))
        messages.append(odom_at(stamp, pose=pose, child="base_footprint"))
        messages.append(scan_at(stamp))
    for options in ({"odom": "tf"}, {}):
        scan = drive(tmp_path, messages, **options)[0][3]
        assert scan.pose_base_laser.x == pytest.approx(0.6)
        assert (scan.pose_odom_base.x, scan.pose_odom_base.y) == pytest.approx((3.0, 0.0))
        scan = drive(tmp_path, messages, base_frame="base_link", **options)[0][3]
        assert scan.pose_base_laser.x == pytest.approx(0.1)
        assert (scan.pose_odom_base.x, scan.pose_odom_base.y) == pytest.approx((3.0, 0.5))


def test_which_motion_is_taken(tmp_path):
    scans = [scan_at(T0 + i * 100 * MS) for i in range(5)]
    odom = [odom_at(T0 + i * 100 * MS) for i in range(5)]
    other = [odom_at(T0 + i * 100 * MS, topic="/wheels", child="base") for i in range(5)]
    tf = [tf_at(planar(T0 + i * 100 * MS, "odom", "base_link", curve(T0))) for i in range(5)]
    cases = [
        (scans, {}, "none"),
        (scans + odom, {}, "/odom"),
        (scans + odom + tf, {}, "/odom"),
        (scans + odom + other + tf, {}, "tf odom -> base_link"),
        (scans + odom + other, {}, "none"),
        (scans + odom + other, {"odom": "/wheels"}, "/wheels"),
        (scans + odom + other, {"odom": "wheels"}, "/wheels"),
        (scans + odom + tf, {"odom": "none"}, "none"),
        (scans + tf, {}, "tf odom -> base_link"),
    ]
    for messages, options, expected in cases:
        ordered = sorted(messages, key=lambda message: message[2])
        found, report = drive(tmp_path, ordered, **options)
        assert report.odometry == expected
        assert (found[2].pose_odom_base is None) == (expected == "none")
    _, report = drive(tmp_path, scans + odom + other)
    assert any("--odom" in warning for warning in report.warnings)
    for options in ({"odom": "/nowhere"}, {"odom": "tf"}, {"odom": "/scan"}):
        with pytest.raises(UsageError, match="--odom"):
            drive(tmp_path, scans + odom, **options)


def test_orientations_of_zeros_and_poses_that_are_no_numbers(tmp_path):
    zero = ROS.Quaternion(x=0.0, y=0.0, z=0.0, w=0.0)
    messages = [
        odom_at(T0, quaternion=zero, pose=SE2(1.0, 2.0, 0.0)),
        scan_at(T0),
        odom_at(T0 + MS, pose=SE2(math.nan, 2.0, 0.0)),
        odom_at(T0 + 2 * MS, pose=SE2(1e300, 2.0, 0.0)),
        odom_at(T0 + 3 * MS, pose=SE2(4.0, 2.0, 0.0)),
        scan_at(T0 + 3 * MS),
    ]
    found, report = drive(tmp_path, messages)
    assert [scan.pose_odom_base.x for scan in found] == [1.0, 4.0]
    assert found[0].pose_odom_base.theta == 0.0
    assert len([w for w in report.warnings if "/odom" in w]) == 2


def test_zero_stamps_take_the_time_of_recording(tmp_path):
    messages = []
    for i in range(5):
        messages += [odom_at(0, T0 + i * MS, pose=SE2(float(i), 0.0, 0.0)), scan_at(0, T0 + i * MS)]
    found, report = drive(tmp_path, messages)
    assert [scan.stamp_ns for scan in found] == [T0 + i * MS for i in range(5)]
    assert [scan.pose_odom_base.x for scan in found] == [0, 1, 2, 3, 4]
    assert sum("zero" in warning for warning in report.warnings) == 1


def test_stamps_that_stand_still_take_the_time_of_recording(tmp_path):
    found, report = drive(tmp_path, [scan_at(T0, T0 + i * 100 * MS) for i in range(9)])
    assert [scan.stamp_ns for scan in found] == [T0 + i * 100 * MS for i in range(9)]
    assert any("stand still" in warning for warning in report.warnings)


def test_odometry_whose_stamps_stand_still_takes_the_time_of_recording(tmp_path):
    messages = []
    for i in range(9):
        at_ns = T0 + i * 100 * MS
        messages += [odom_at(7, at_ns, pose=SE2(float(i), 0.0, 0.0)), scan_at(7, at_ns)]
    found, report = drive(tmp_path, messages)
    assert [scan.pose_odom_base.x for scan in found] == list(range(9))
    assert report.stamps_replaced == ["/scan"]


def test_a_base_frame_that_is_not_there(tmp_path):
    messages = [odom_at(T0), scan_at(T0)]
    with pytest.raises(BsmapError, match="--base-frame"):
        drive(tmp_path, messages, base_frame="torso")
