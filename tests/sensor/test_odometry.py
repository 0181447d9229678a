import math

import numpy as np
import pytest

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.motion import Route
from bsmap_cli.sensor.simulator.odometry import OdometryModel, odometry_poses

PERFECT = OdometryModel(
    scale_sigma=0.0,
    turn_scale_sigma=0.0,
    distance_sigma=0.0,
    turn_sigma=0.0,
    heading_sigma=0.0,
    slip_share=0.0,
    slip_turn_rad_s=0.0,
)
ROUTE = Route(SE2(3.0, 1.0, 0.7)).turn(50).drive((8.0, 9.0), (0.0, 12.0), (30.0, 14.0)).wait(5.0)
TIMES_S = np.linspace(0.0, ROUTE.motion().duration_s, 700)


def run(model, seed=0):
    return odometry_poses(ROUTE.motion(), TIMES_S, model, np.random.default_rng(seed))


def end_error(poses):
    """(metres, degrees) between the last pose and the truth, both from the first pose."""
    first, last = (SE2.from_array(row) for row in ROUTE.motion().poses(TIMES_S[[0, -1]]))
    off = (first.inverse() @ last).inverse() @ SE2.from_array(poses[-1])
    return math.hypot(off.x, off.y), abs(math.degrees(off.theta))


def test_without_errors_it_is_the_truth_from_the_first_pose():
    poses = run(PERFECT)
    assert poses[0].tolist() == [0.0, 0.0, 0.0]
    truth = ROUTE.motion().poses(TIMES_S)
    first = SE2.from_array(truth[0]).inverse()
    assert poses[:, :2] == pytest.approx(first.transform(truth[:, :2]), abs=2e-3)
    assert poses[:, 2] == pytest.approx(truth[:, 2] - truth[0, 2], abs=1e-4)  # between ticks


def test_it_is_wrong_by_a_plausible_amount():
    errors = np.array([end_error(run(OdometryModel(), seed)) for seed in range(40)])
    metres, degrees = np.median(errors, axis=0)
    travelled_m = 49.0
    assert 0.01 * travelled_m < metres < 0.1 * travelled_m
    assert 1.0 < degrees < 15.0


def test_same_seed_same_odometry_other_seed_other():
    assert np.array_equal(run(OdometryModel(), 5), run(OdometryModel(), 5))
    assert not np.array_equal(run(OdometryModel(), 5), run(OdometryModel(), 6))


def test_scale_error_stretches_the_path():
    model = OdometryModel(scale_sigma=0.05, metres_per_slip=1e9, **_quiet())
    stretch = [_length(run(model, seed)) / _length(run(PERFECT)) for seed in range(60)]
    assert np.std(stretch) == pytest.approx(0.05, rel=0.4)
    assert np.mean(stretch) == pytest.approx(1.0, abs=4 * 0.05 / math.sqrt(60))


def test_slip_adds_distance_and_turn_only_while_driving():
    model = OdometryModel(scale_sigma=0.0, metres_per_slip=5.0, **_quiet())
    slipped, true = run(model), run(PERFECT)
    assert _length(slipped) > 1.002 * _length(true)
    still = TIMES_S[-1] - TIMES_S < 4.9
    assert np.ptp(slipped[still], axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)


def test_no_jump_from_scan_to_scan():
    steps = np.diff(run(OdometryModel()), axis=0)
    period_s = TIMES_S[1]
    assert np.hypot(steps[:, 0], steps[:, 1]).max() < 2.0 * 0.6 * period_s
    assert np.abs(steps[:, 2]).max() < 2.0 * 0.8 * period_s


def _quiet():
    return dict(turn_scale_sigma=0.0, distance_sigma=0.0, turn_sigma=0.0, heading_sigma=0.0)


def _length(poses):
    return np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()
