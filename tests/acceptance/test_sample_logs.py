"""Every sample log against its truth, held to what noise and odometry allow."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from bsmap_cli.evaluation.redundancy import redundancy
from bsmap_cli.evaluation.trajectory_error import absolute_error, match_poses
from bsmap_cli.exchange.tum import read_tum
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.sensor.trajectory import Trajectory
from tests.acceptance.driving import SAMPLES, run_log

NOISE_M = 0.01  # of one range; a pose rests on hundreds, or on a hundred with the LMS 200
FINEST_M = 0.1  # knot step of the map
ROOMS = ("wall.mcap", "spin.bag", "shapes.mcap")
LOOPS = ("loop.csv.gz", "twins.bag")
WHEELED = ("shapes.mcap", *LOOPS, "loop-sparse.mcap")


@cache
def run(name):
    return run_log(SAMPLES / name)


@cache
def truth_of(name):
    with (SAMPLES / f"{name.partition('.')[0]}.truth.tum").open() as lines:
        return read_tum(lines)


def off_m(trajectory, name):
    """Root mean square distance to the truth, aligned."""
    return absolute_error(match_poses(trajectory, truth_of(name))).as_json()["rmse_m"]


def odometry_of(name):
    with open_log([SAMPLES / name], ReadOptions()) as reader:
        scans = list(reader.scans())
    stamps = np.array([scan.stamp_ns for scan in scans], np.int64)
    return Trajectory(stamps, np.array([scan.pose_odom_base.as_array() for scan in scans]))


@pytest.mark.parametrize("name", ROOMS)
def test_in_one_room_poses_are_better_than_one_range(name):
    assert off_m(run(name).trajectory, name) < NOISE_M


@pytest.mark.parametrize("name", LOOPS)
def test_round_a_building_poses_stay_within_half_a_knot_step(name):
    assert off_m(run(name).trajectory, name) < 0.5 * FINEST_M
    assert run(name).figures["loops"] > 0


@pytest.mark.parametrize("name", WHEELED)
def test_poses_are_several_times_better_than_the_odometry(name):
    assert off_m(run(name).trajectory, name) < off_m(odometry_of(name), name) / 3.0


def test_along_bare_walls_poses_are_as_good_as_the_odometry():
    name = "corridor.mcap"
    assert off_m(run(name).trajectory, name) < 1.2 * off_m(odometry_of(name), name)
    assert run(name).figures["degenerate_share"] > 0.9


@pytest.mark.parametrize("name", [*ROOMS, *LOOPS, "loop-sparse.mcap", "corridor.mcap"])
def test_every_scan_has_its_pose_and_no_wall_is_drawn_twice(name):
    assert run(name).trajectory.stamps_ns.tolist() == truth_of(name).stamps_ns.tolist()
    assert run(name).figures["tracking_lost"] == []
    assert redundancy(run(name).document.finest) <= 1.05
