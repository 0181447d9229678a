"""Trajectories in other formats."""

import io

import numpy as np
import pytest

from bsmap_cli.errors import LogError
from bsmap_cli.exchange.trajectories import WRITERS, read_trajectory
from bsmap_cli.sensor.trajectory import Trajectory

STAMPS = np.array([976052857_338000001, 976052857_337000000, -5], np.int64)
POSES = np.array([[1.5, -2.25, 3.0], [0.1, 1e-7, -3.1], [-1e4, 12.0, 0.0]])
TRAJECTORY = Trajectory(STAMPS, POSES)


def text(format_, trajectory=TRAJECTORY):
    stream = io.StringIO()
    WRITERS[format_](stream, trajectory)
    return stream.getvalue()


@pytest.mark.parametrize("format_", ["tum", "csv", "json"])
@pytest.mark.parametrize("before", ["", "# a comment\n\n"])
def test_each_format_is_known_from_its_content(format_, before):
    lines = (before + text(format_)).splitlines(keepends=True)
    found = read_trajectory(lines)
    np.testing.assert_array_equal(found.stamps_ns, STAMPS)
    np.testing.assert_allclose(found.poses, POSES, rtol=0, atol=3e-9)


@pytest.mark.parametrize("format_", ["tum", "csv", "json"])
def test_no_poses(format_):
    empty = Trajectory(np.zeros(0, np.int64), np.zeros((0, 3)))
    assert len(read_trajectory(text(format_, empty).splitlines())) == 0


def test_kitti_rows_are_matrices():
    for line, (x, y, yaw) in zip(text("kitti").splitlines(), POSES, strict=True):
        matrix = np.array(line.split(), float).reshape(3, 4)
        np.testing.assert_allclose(matrix[:, 3], [x, y, 0.0], atol=1e-9)
        np.testing.assert_allclose(matrix[:, :3] @ matrix[:, :3].T, np.eye(3), atol=1e-8)
        assert np.arctan2(matrix[1, 0], matrix[0, 0]) == pytest.approx(yaw, abs=1e-8)


def test_csv_columns_by_name_in_any_order_and_seconds():
    found = read_trajectory(["theta, y, x, more, t\n", "0.5,2,1,9,976052857.338000001\n"])
    assert found.stamps_ns.tolist() == [976052857_338000001]
    assert found.poses.tolist() == [[1.0, 2.0, 0.5]]


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["t,x,y\n", "1,2,3\n"], "no column theta: it has t, x, y"),
        (["t,x,y,theta\n", "1,2,3,0\n", "1,2,nan,4\n"], "line 3 of the trajectory"),
        (["t,x,y,theta\n", "1,2\n"], "line 2 of the trajectory"),
        (["stamp_ns,x,y,theta\n", "1.5,2,3,4\n"], "line 2 of the trajectory"),
        (['{"poses":[{}]}'], "not a trajectory in JSON: KeyError"),
        (["{"], "not a trajectory in JSON"),
        (['{"poses":[{"stamp_ns":1,"x_m":NaN,"y_m":0,"yaw_rad":0}]}'], "not finite"),
    ],
)
def test_what_is_no_trajectory(lines, message):
    with pytest.raises(LogError, match=message):
        read_trajectory(lines)
