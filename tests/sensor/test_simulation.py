import math
from itertools import islice

import numpy as np
import pytest

from bsmap_cli.errors import UsageError
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.grid import grid_of, single_cell
from bsmap_cli.sensor.simulator.lidar import LIDARS
from bsmap_cli.sensor.simulator.raycast import cast_rays
from bsmap_cli.sensor.simulator.scenes import SCENES
from bsmap_cli.sensor.simulator.simulation import FIRST_STAMP_NS, simulate
from tests.sensor.oracles import distances_to, end_points
from tests.sensor.test_motion import rates

ASKEW = SE2(0.8, -0.1, 0.2)


def digest(simulation, count=25):
    return [
        (scan.stamp_ns, scan.ranges_m.tobytes(), scan.pose_odom_base)
        for scan in islice(simulation.scans(), count)
    ]


def spread(simulation, count):
    """(index, scan) for about `count` scans all over the run."""
    every = max(1, len(simulation) // count)
    return [(k, scan) for k, scan in enumerate(simulation.scans()) if k % every == 0]


@pytest.mark.parametrize("scene", SCENES)
def test_every_end_point_lies_on_a_surface(scene):
    """Exact ranges, through the truth as written, fall on the surfaces as written."""
    simulation = simulate(
        scene, lidar="lms200", noise_m=0.0, rate_hz=0.5, pose_base_laser=ASKEW, seed=3
    )
    surfaces = simulation.world.surfaces()
    moving = [guest for guest in simulation.world.guests if not guest.stands]
    hits = 0
    for index, scan in spread(simulation, 12):
        time_s = (scan.stamp_ns - FIRST_STAMP_NS) / 1e9
        pose_world_base = SE2.from_array(simulation.truth.poses[index])
        points = (pose_world_base @ scan.pose_base_laser).transform(end_points(scan))
        there = [line.points for line in surfaces if line.from_s <= time_s < line.to_s]
        for guest in moving:
            there += guest.shapes.at(guest.pose_world_guest(time_s)).polylines()
        assert distances_to(there, points).max(initial=0.0) < 1e-4
        hits += len(points)
    assert hits > 500


@pytest.mark.parametrize("scene", SCENES)
def test_the_robot_moves_like_one(scene):
    motion = SCENES[scene].build().motion
    ahead, aside, turning, gaining, swerving = rates(motion, 5e-3)
    assert ahead.max() <= 1.2 and np.abs(turning).max() <= 1.0
    assert np.abs(aside).max() < 1e-3
    assert np.abs(gaining).max() <= 0.7 and np.abs(swerving).max() <= 2.0


@pytest.mark.parametrize("scene", SCENES)
def test_the_robot_keeps_clear_of_everything(scene):
    plan = SCENES[scene].build()
    around = np.linspace(-math.pi, math.pi, 181)
    times_s = np.linspace(0.0, plan.motion.duration_s, 300)
    standing = grid_of(plan.world.standing)
    for time_s, pose in zip(times_s, plan.motion.poses(times_s), strict=True):
        ranges = np.full(len(around), math.inf)
        for grid in (standing, single_cell(plan.world.visitors(float(time_s)))):
            cast_rays(grid, pose[None], around, math.inf, ranges)
        assert ranges.min() > 0.3, f"at {time_s:.1f} s, {pose}"


@pytest.mark.parametrize("lidar", ["ust10lx", "lms200"])
@pytest.mark.parametrize("scene", SCENES)
def test_every_scene_can_be_seen(scene, lidar):
    simulation = simulate(scene, lidar=lidar, rate_hz=0.2)
    shares = [np.isfinite(scan.ranges_m).mean() for _, scan in spread(simulation, 20)]
    assert len(shares) >= 3
    assert min(shares) > (0.1 if lidar == "lms200" or scene != "campus" else 0.0)
    assert len(simulation) == len(simulation.truth) == sum(1 for _ in simulation.scans())


@pytest.mark.parametrize("lidar", LIDARS)
def test_noisy_end_points_scatter_about_the_surfaces_as_the_lidar_says(lidar):
    """Median distance of a Gaussian's half: 0.6745 sigma, less where walls are seen aslant."""
    simulation = simulate("loop", lidar=lidar, rate_hz=0.1, seed=2)
    walls = [surface.points for surface in simulation.world.surfaces()]
    model, distances = LIDARS[lidar], []
    for index, scan in spread(simulation, 8):
        pose = SE2.from_array(simulation.truth.poses[index])
        distances.append(distances_to(walls, pose.transform(end_points(scan))))
    off = np.concatenate(distances)
    assert 0.2 * model.range_sigma_m < np.median(off) < 1.5 * model.range_sigma_m
    stray = np.mean(off > 0.15)
    assert 0.3 * model.outlier_share <= stray <= 1.5 * model.outlier_share


def test_same_seed_same_scans_other_seed_other_scans():
    first = digest(simulate("wall", seed=4))
    assert first == digest(simulate("wall", seed=4))
    other = digest(simulate("wall", seed=5))
    assert all(left[0] == right[0] for left, right in zip(first, other, strict=True))
    assert not any(left[1] == right[1] for left, right in zip(first, other, strict=True))
    assert first[-1][2] != other[-1][2]


def test_scans_can_be_drawn_again():
    simulation = simulate("spin", lidar="urg04lx")
    assert digest(simulation) == digest(simulation)


def test_no_odometry_changes_nothing_else():
    with_wheels, without = simulate("wall"), simulate("wall", odometry=False)
    assert without.odometry is None
    for left, right in zip(digest(with_wheels), digest(without), strict=True):
        assert left[:2] == right[:2]
        assert left[2] is not None and right[2] is None


def test_odometry_starts_where_the_base_starts():
    simulation = simulate("loop", lidar="lms200")
    assert next(simulation.scans()).pose_odom_base == SE2(0.0, 0.0, 0.0)


def test_stamps_are_regular_whole_nanoseconds():
    simulation = simulate("wall", lidar="lms200", rate_hz=75.0)
    steps = np.diff(simulation.truth.stamps_ns)
    assert simulation.truth.stamps_ns.dtype == np.int64
    assert simulation.truth.stamps_ns[0] == FIRST_STAMP_NS
    assert set(steps.tolist()) == {13_333_333, 13_333_334}


def test_truth_angles_are_wrapped():
    yaws = simulate("spin", lidar="lms200").truth.poses[:, 2]
    assert yaws.max() <= math.pi and yaws.min() > -math.pi
    assert np.ptp(np.unwrap(yaws)) == pytest.approx(math.tau, abs=0.01)


def test_scan_fields_are_those_of_the_lidar():
    scan = next(simulate("wall", pose_base_laser=ASKEW).scans())
    assert len(scan.ranges_m) == 1081 and scan.ranges_m.dtype == np.float32
    assert math.degrees(scan.angle_min_rad) == pytest.approx(-135.0, abs=1e-5)
    assert (scan.range_min_m, scan.range_max_m) == (np.float32(0.06), 10.0)
    assert scan.time_increment_s == 0.0 and scan.pose_base_laser == ASKEW


def test_a_sweep_smears_by_the_motion_of_the_base():
    """Placed with each beam's own pose the points are on the walls, with the first one's not."""
    simulation = simulate("spin", lidar="urg04lx", noise_m=0.0, outlier_share=0.0, sweep=True)
    index, scan = spread(simulation, 3)[1]
    assert scan.time_increment_s == pytest.approx(0.1 / 1024)
    walls = [surface.points for surface in simulation.world.surfaces()]
    valid = np.flatnonzero(np.isfinite(scan.ranges_m))
    start_s = (scan.stamp_ns - FIRST_STAMP_NS) / 1e9
    poses = simulation.motion.poses(start_s + valid * scan.time_increment_s)
    points = end_points(scan)
    placed = [
        SE2.from_array(pose).transform(point) for pose, point in zip(poses, points, strict=True)
    ]
    assert distances_to(walls, np.array(placed)).max() < 1e-4
    frozen = SE2.from_array(simulation.truth.poses[index]).transform(points)
    assert distances_to(walls, frozen).max() > 0.03


def test_key_frames_lie_a_step_apart():
    simulation = simulate("loop", lidar="lms200", step_m=1.0)
    poses = simulation.truth.poses
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    turns = np.abs(np.diff(np.unwrap(poses[:, 2])))
    assert np.all((steps >= 0.95) | (turns >= 0.5))
    assert steps.max() < 1.2
    assert 150 < len(simulation) < 260


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"scene": "moon"}, "unknown scene 'moon': choose one of wall, spin"),
        ({"scene": "wall", "lidar": "sonar"}, "unknown lidar 'sonar': choose one of ust10lx"),
        ({"scene": "wall", "noise_m": -0.1}, "noise_m is -0.1: give a finite number"),
        ({"scene": "wall", "noise_m": math.nan}, "noise_m is nan"),
        ({"scene": "wall", "seed": -1}, "seed is -1"),
        ({"scene": "wall", "rate_hz": 0.0}, "rate_hz is 0: ust10lx does up to 40"),
        ({"scene": "wall", "rate_hz": 100.0}, "rate_hz is 100: ust10lx does up to 40"),
    ],
)
def test_wrong_arguments_are_refused(arguments, message):
    with pytest.raises(UsageError, match=message):
        simulate(**arguments)
