"""ATE and RPE beside plain loops over poses."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from bsmap_cli.errors import LogError
from bsmap_cli.evaluation.pose_arrays import nearest_stamps, relative_poses, transform_poses
from bsmap_cli.evaluation.trajectory_error import (
    absolute_error,
    align,
    match_poses,
    relative_error,
    rms,
)
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.trajectory import Trajectory


def wandering(count, seed=0, step_s=0.1):
    rng = np.random.default_rng(seed)
    yaw = np.cumsum(rng.normal(0, 0.2, count))
    steps = rng.uniform(0.0, 0.3, count)[:, None] * np.column_stack((np.cos(yaw), np.sin(yaw)))
    stamps = (np.arange(count) * step_s * 1e9).astype(np.int64) + 976052857 * 10**9
    return Trajectory(stamps, np.column_stack((np.cumsum(steps, axis=0), yaw)))


def noisy(trajectory, seed=1):
    rng = np.random.default_rng(seed)
    noise = rng.normal(0, [0.02, 0.02, 0.01], trajectory.poses.shape)
    return Trajectory(trajectory.stamps_ns, trajectory.poses + noise)


def test_relative_poses_is_inverse_times():
    a, b = wandering(20).poses, wandering(20, 5).poses
    for row, (p, q) in zip(relative_poses(a, b), zip(a, b, strict=True), strict=True):
        expected = SE2.from_array(p).inverse() @ SE2.from_array(q)
        np.testing.assert_allclose(row, expected.as_array(), atol=1e-12)


def test_transform_poses_is_composition():
    motion = SE2(1.0, -2.0, 3.0)
    for row, p in zip(
        transform_poses(motion, wandering(20).poses), wandering(20).poses, strict=True
    ):
        np.testing.assert_allclose(row, (motion @ SE2.from_array(p)).as_array(), atol=1e-12)


@given(st.lists(st.integers(0, 30), min_size=1, max_size=9), st.lists(st.integers(-5, 35)))
def test_nearest_stamp_is_the_naive_one(stamps, wanted):
    rows, off = nearest_stamps(np.array(stamps, np.int64), np.array(wanted, np.int64))
    for want, row, distance in zip(wanted, rows, off, strict=True):
        assert distance == abs(stamps[row] - want) == min(abs(s - want) for s in stamps)
        key = [(abs(s - want), s, i) for i, s in enumerate(stamps)]
        assert row == min(key)[2]


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.1, 3.1))
def test_a_moved_trajectory_has_no_error(x, y, theta):
    reference = wandering(80)
    moved = transform_poses(SE2(x, y, theta), reference.poses)
    matched = match_poses(Trajectory(reference.stamps_ns, moved), reference)
    ate = absolute_error(matched).as_json()
    assert max(ate["max_m"], ate["rotation_rmse_deg"]) < 1e-9
    rpe = relative_error(matched).as_json()
    assert max(rpe["rmse_m"], rpe["rmse_deg"]) < 1e-9


def test_alignment_is_the_least_squares_one():
    reference = wandering(60)
    matched = match_poses(noisy(reference), reference)

    def cost(p):
        off = SE2.from_array(p).transform(matched.estimate[:, :2]) - matched.reference[:, :2]
        return float(np.sum(off**2))

    best = minimize(cost, np.zeros(3), tol=1e-12)
    assert cost(align(matched).as_array()) <= best.fun + 1e-9


def test_ate_figures_beside_a_loop():
    reference = wandering(60)
    matched = match_poses(noisy(reference), reference)
    motion = align(matched)
    distances, angles = [], []
    for p, q in zip(matched.estimate, matched.reference, strict=True):
        moved = motion @ SE2.from_array(p)
        distances.append(math.hypot(moved.x - q[0], moved.y - q[1]))
        angles.append(abs(math.degrees(math.remainder(moved.theta - q[2], math.tau))))
    figures = absolute_error(matched).as_json()
    assert figures["rmse_m"] == pytest.approx(math.sqrt(np.mean(np.square(distances))))
    assert figures["mean_m"] == pytest.approx(np.mean(distances))
    assert figures["median_m"] == pytest.approx(np.median(distances))
    assert figures["max_m"] == pytest.approx(max(distances))
    assert figures["rotation_rmse_deg"] == pytest.approx(math.sqrt(np.mean(np.square(angles))))


def test_rpe_beside_a_loop():
    reference = wandering(90)
    matched = match_poses(noisy(reference), reference)
    distances, angles = [], []
    for i in range(90):
        travelled = 0.0
        for j in range(i + 1, 90):
            travelled += math.hypot(*(matched.reference[j] - matched.reference[j - 1])[:2])
            if travelled >= 1.0:
                r = [SE2.from_array(matched.reference[k]) for k in (i, j)]
                e = [SE2.from_array(matched.estimate[k]) for k in (i, j)]
                off = (r[0].inverse() @ r[1]).inverse() @ (e[0].inverse() @ e[1])
                distances.append(math.hypot(off.x, off.y))
                angles.append(abs(math.degrees(off.theta)))
                break
    error = relative_error(matched)
    np.testing.assert_allclose(error.translation_m, distances, atol=1e-9)
    np.testing.assert_allclose(error.rotation_deg, angles, atol=1e-9)
    assert error.as_json()["per"] == "1 m"


def test_a_turn_on_the_spot_is_aligned_by_its_headings():
    yaw = np.linspace(0, 2 * np.pi, 50)
    rng = np.random.default_rng(3)
    stamps = np.arange(50) * 10**8
    reference = Trajectory(stamps, np.column_stack((np.zeros((50, 2)), yaw)))
    estimate = Trajectory(stamps, np.column_stack((rng.normal(0, 1e-3, (50, 2)), yaw + 0.5)))
    error = absolute_error(match_poses(estimate, reference))
    assert error.as_json()["rotation_rmse_deg"] < 1e-6
    assert error.as_json()["max_m"] < 0.01


def test_too_short_a_way_has_no_relative_error():
    reference = wandering(3)
    figures = relative_error(match_poses(reference, reference), delta_m=50.0).as_json()
    assert figures == {"per": "50 m", "rmse_m": None, "mean_m": None, "rmse_deg": None}


def test_stamps_that_step_back_are_matched():
    reference = wandering(40)
    order = np.arange(40)
    order[10], order[11] = 11, 10
    shuffled = Trajectory(reference.stamps_ns[order], reference.poses[order])
    matched = match_poses(shuffled, reference)
    np.testing.assert_array_equal(matched.estimate, matched.reference)


def test_only_poses_near_in_time_match():
    reference = wandering(40)
    late = Trajectory(reference.stamps_ns + 15_000_000, reference.poses)
    assert len(match_poses(late, reference).stamps_ns) == 40
    with pytest.raises(LogError, match=r"no poses within 0.01 s"):
        match_poses(late, reference, max_dt_s=0.01)
    with pytest.raises(LogError, match="without poses"):
        match_poses(Trajectory(np.zeros(0, np.int64), np.zeros((0, 3))), reference)


def test_the_shorter_trajectory_decides_the_pairs():
    dense, sparse = wandering(100, step_s=0.01), wandering(100, step_s=0.01)
    sparse = Trajectory(sparse.stamps_ns[::10], sparse.poses[::10])
    for a, b in ((dense, sparse), (sparse, dense)):
        matched = match_poses(a, b)
        assert len(matched.stamps_ns) == 10
        np.testing.assert_array_equal(matched.estimate, matched.reference)


def test_rms():
    assert rms(np.array([3.0, 4.0])) == pytest.approx(math.sqrt(12.5))
