"""Logs of real robots, where they lie beside the checkout."""

import math
from pathlib import Path

import numpy as np
import pytest

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from tests.logs.making import float32, read

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason="no real logs: ../shared/data is not beside the checkout"
)


@pytest.fixture(scope="module")
def csail():
    return read(DATA / "mit-csail.clf.gz")[0]


def test_csail(csail):
    assert len(csail) == 1988
    assert csail[0].stamp_ns == 1134864629895182000
    assert csail[0].pose_odom_base.x == 576.536523
    assert {len(scan.ranges_m) for scan in csail} == {361}
    assert {scan.pose_base_laser for scan in csail} == {SE2.identity()}


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("mit-csail_ros1.bag", 1988),
        ("mit-csail_ros2_mcap", 1988),
        ("mit-csail_ros2_mcap/mit-csail_ros2_mcap.mcap", 1988),
        ("mit-csail_foxglove_json.mcap", 500),
    ],
)
def test_csail_in_other_containers(csail, name, count):
    found, report = read(DATA / name)
    assert len(found) == count
    assert (report.scans_skipped, report.truncated) == (0, False)
    for a, b in zip(found, csail[:count], strict=True):
        assert abs(a.stamp_ns - b.stamp_ns) < 1000
        assert (a.angle_min_rad, a.angle_increment_rad) == (b.angle_min_rad, b.angle_increment_rad)
        seen = b.ranges_m < 50.0
        np.testing.assert_array_equal(a.ranges_m[seen], b.ranges_m[seen])
        assert not (a.ranges_m[~seen] < 50.0).any()
        assert a.pose_odom_base == b.pose_odom_base
        assert a.pose_base_laser == b.pose_base_laser


def test_csail_by_its_tree_of_frames(csail):
    found, report = read(DATA / "mit-csail_ros2_mcap", odom="tf")
    assert report.odometry == "tf odom -> base_link"
    assert [scan.pose_odom_base for scan in found] == [scan.pose_odom_base for scan in csail]


def test_intel():
    found, report = read(DATA / "intel.clf.gz")
    assert len(found) == 13631
    assert report.warnings == []
    stamps = np.array([scan.stamp_ns for scan in found])
    assert (np.diff(stamps) < -20_000_000).sum() == 614
    assert found[0].stamp_ns == 976052857337530000
    assert found[0].angle_min_rad == float32(-math.pi / 2)
    assert found[0].ranges_m.max() == np.float32(81.83)
    path = np.array([scan.pose_odom_base.as_array()[:2] for scan in found])
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).sum() == pytest.approx(508, abs=1)


def test_a_tilting_laser():
    found, report = read(DATA / "tilt_laser.bag")
    assert len(found) == 178
    assert {len(scan.ranges_m) for scan in found} == {1078}
    below = [np.mean(scan.ranges_m < scan.range_min_m) for scan in found]
    assert np.mean(below) == pytest.approx(0.38, abs=0.01)
    assert found[0].time_increment_s == float32(1.7361111531499773e-05)
    assert any("tilted" in warning for warning in report.warnings)
    assert report.odometry == "none"


def test_info_of_a_bag():
    with open_log([DATA / "tilt_laser.bag"], ReadOptions()) as reader:
        info = reader.info()
    assert (info.format, info.selected, info.beams) == ("ROS 1 bag", ("/scan",), 1078)
    counts = {topic.topic: topic.messages for topic in info.topics}
    assert counts["/scan"] == 178
    assert counts["/tf"] == 711
