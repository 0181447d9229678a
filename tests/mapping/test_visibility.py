"""What is looked through goes from the map, what stands stays: by hand, and on moving scenes."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.spatial import KDTree

from bsmap_cli.config import load_settings
from bsmap_cli.evaluation.trajectory_error import absolute_error, match_poses
from bsmap_cli.evaluation.true_surfaces import cut_surfaces
from bsmap_cli.mapping.evidence import VisibilitySettings, remove_unseen
from bsmap_cli.mapping.freeze import freeze_level
from bsmap_cli.mapping.sampling import sample_level
from bsmap_cli.mapping.visibility import DARK, HIT, MISS, look_at
from bsmap_cli.sensor.sight import Sight
from bsmap_cli.sensor.simulator.simulation import simulate
from bsmap_cli.slam.slam import Slam
from tests.mapping.walls import insert, line, new_map

SIGMA_M = 0.01
STEP_RAD = np.radians(0.5)
FIRST_RAD = -np.pi / 2
ORIGIN = np.zeros(3)
SETTINGS = VisibilitySettings()
MIN_LENGTH = 0.75

NEAR = ((2.0, -1.0), (2.0, 1.0))  # free side towards the origin, from where all beams leave
FAR = ((5.0, -6.0), (5.0, 6.0))


def toward_origin(start, end, spacing=0.02):
    """A wall as the origin sees it: points in beam order have their free side on the left."""
    return line(start, end, spacing)


def map_of(*walls, times=5):
    curve_map = new_map(0.1)
    for _ in range(times):
        insert(curve_map, *[toward_origin(*wall) for wall in walls])
    return curve_map


def view(*walls, reach_m=10.0, pose=ORIGIN):
    """A half circle of beams from `pose`, cast against segments; inf where nothing returns."""
    bearings = FIRST_RAD + STEP_RAD * np.arange(361) + pose[2]
    ranges = np.full(len(bearings), np.inf)
    ways = np.stack((np.cos(bearings), np.sin(bearings)), axis=1)
    for start, end in walls:
        a, b = np.array(start) - pose[:2], np.array(end) - pose[:2]
        d = b - a
        cross = ways[:, 0] * d[1] - ways[:, 1] * d[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            r = (a[0] * d[1] - a[1] * d[0]) / cross
            share = (a[0] * ways[:, 1] - a[1] * ways[:, 0]) / cross
        hit = (cross != 0) & (r > 0) & (share >= 0) & (share <= 1)
        ranges = np.where(hit & (r < ranges), r, ranges)
    ranges[ranges > reach_m] = np.inf
    return Sight(np.array([0.0, 0.0, FIRST_RAD]), STEP_RAD, ranges.astype(np.float32))


def drawn(curve_map):
    """(n, 2) samples of what the map draws, 1 cm apart."""
    return sample_level(freeze_level(curve_map, max_weight=50), 0.01).points


def length_near(curve_map, x):
    """Metres drawn within 10 cm of the line at x."""
    points = drawn(curve_map)
    return 0.01 * np.sum(np.abs(points[:, 0] - x) < 0.1) if len(points) else 0.0


def verdicts_near(curve_map, look, x):
    middles = curve_map.arrays.spans[look.rows, :2]
    return look.verdicts[np.abs(middles[:, 0] - x) < 0.1]


def remove(curve_map, views, **rest):
    remove_unseen(
        curve_map, views, sigma_m=SIGMA_M, settings=SETTINGS, min_length=MIN_LENGTH, **rest
    )


def test_a_wall_that_is_seen_is_hit():
    curve_map = map_of(NEAR)
    verdicts = look_at(curve_map, view(NEAR), ORIGIN, SIGMA_M).verdicts
    assert len(verdicts) >= 15
    assert (verdicts == HIT).all()


def test_a_wall_that_is_looked_through_is_missed():
    curve_map = map_of(NEAR)
    verdicts = look_at(curve_map, view(FAR), ORIGIN, SIGMA_M).verdicts
    assert len(verdicts) >= 15
    assert (verdicts == MISS).all()


def test_where_nothing_returns_the_verdict_is_dark():
    curve_map = map_of(NEAR)
    elsewhere = ((-0.5, -9.0), (0.5, -9.0))  # one beam must come back to tell how far they reach
    verdicts = look_at(curve_map, view(elsewhere), ORIGIN, SIGMA_M).verdicts
    assert len(verdicts) > 0
    assert (verdicts == DARK).all()


def test_later_views_take_out_what_they_look_through_and_nothing_else():
    curve_map = map_of(NEAR, FAR)
    before, after = view(NEAR, FAR), view(FAR)
    far_m = length_near(curve_map, 5.0)
    remove(curve_map, [(before, ORIGIN)] * 5 + [(after, ORIGIN)] * 15)
    assert length_near(curve_map, 2.0) == 0.0
    assert length_near(curve_map, 5.0) >= far_m - 0.02


@pytest.mark.parametrize("others", [0, 3])
def test_what_comes_to_stay_stays(others):
    """Looked through at first, then there in more views than it was not."""
    curve_map = map_of(NEAR, FAR)
    near_m = length_near(curve_map, 2.0)
    empty, there = view(FAR), view(NEAR, FAR)
    remove(curve_map, [(empty, ORIGIN)] * others + [(there, ORIGIN)] * 50)
    assert length_near(curve_map, 2.0) >= near_m - 0.02


def test_a_wall_behind_another_stays():
    curve_map = map_of(NEAR, FAR)
    behind_m = length_near(curve_map, 5.0)
    hidden = ((2.0, -6.0), (2.0, 6.0))
    look = look_at(curve_map, view(hidden), ORIGIN, SIGMA_M)
    assert len(verdicts_near(curve_map, look, 5.0)) == 0
    remove(curve_map, [(view(hidden), ORIGIN)] * 100)
    assert length_near(curve_map, 5.0) == behind_m


def test_a_wall_beyond_all_beams_stays():
    curve_map = map_of(FAR)
    far_m = length_near(curve_map, 5.0)
    near_by = ((0.5, -3.0), (1.5, -3.0))
    remove(curve_map, [(view(near_by, reach_m=4.0), ORIGIN)] * 100)
    assert length_near(curve_map, 5.0) == far_m


def test_a_wall_at_grazing_incidence_stays():
    """More than 70 degrees from its normal, a wall is not judged: beams pass along it."""
    along = ((1.0, -0.3), (6.0, -0.3))
    curve_map = map_of(along)
    before = drawn(curve_map)
    back = ((8.0, -6.0), (8.0, 6.0))
    remove(curve_map, [(view(back), ORIGIN)] * 100)
    assert np.array_equal(drawn(curve_map), before)


def test_a_wall_that_faces_away_stays():
    curve_map = map_of(NEAR[::-1])
    before = drawn(curve_map)
    remove(curve_map, [(view(FAR), ORIGIN)] * 100)
    assert np.array_equal(drawn(curve_map), before)


def test_an_error_of_the_pose_by_half_a_knot_step_takes_nothing():
    curve_map = map_of(NEAR, FAR)
    seen_m = [length_near(curve_map, x) for x in (2.0, 5.0)]
    off = [
        np.array([dx, dy, turn])
        for dx in (-0.03, 0.03)
        for dy in (-0.03, 0.03)
        for turn in (-0.005, 0.005)
    ]
    remove(curve_map, [(view(NEAR, FAR), pose) for pose in off * 10])
    assert [length_near(curve_map, x) for x in (2.0, 5.0)] == seen_m


def test_the_same_views_leave_the_same_curves():
    left = []
    for _ in range(2):
        curve_map = map_of(NEAR, FAR)
        remove(curve_map, [(view(NEAR, FAR), ORIGIN)] * 3 + [(view(FAR), ORIGIN)] * 6)
        left.append(drawn(curve_map).tobytes())
    assert left[0] == left[1]


SCENES = (("people", "ust10lx"), ("yard", "utm30lx"), ("changes", "ust10lx"))


@cache
def finished(scene, lidar, method):
    """(n, 2) samples of the map in the world, 1 cm apart, and the simulation."""
    simulation = simulate(scene, lidar=lidar, seed=1, rate_hz=10.0)
    slam = Slam(load_settings(overrides=[f"visibility.method={method}"]))
    for scan in simulation.scans():
        slam.process(scan)
    result = slam.finish()
    absolute = absolute_error(match_poses(result.trajectory, simulation.truth))
    samples = sample_level(result.document.finest, 0.01).points
    return absolute.pose_reference_estimate.transform(samples), simulation


def standing(simulation):
    """What stands when the run ends, and stood still until then."""
    end_s = 1e-9 * float(simulation.truth.stamps_ns[-1] - simulation.truth.stamps_ns[0])
    return [
        surface.points
        for surface in simulation.world.surfaces()
        if surface.from_s <= end_s <= surface.to_s
    ]


def ghosts_m(scene, lidar, method):
    """Metres drawn where nothing stands, and metres drawn at all."""
    points, simulation = finished(scene, lidar, method)
    away = cut_surfaces(standing(simulation)).distances(points) > 0.15
    return 0.01 * away.sum(), 0.01 * len(away)


@pytest.mark.parametrize(("scene", "lidar"), [SCENES[0], SCENES[2]])
def test_the_map_shows_what_stands_at_the_end(scene, lidar):
    ghost_m, drawn_m = ghosts_m(scene, lidar, "evidence")
    assert ghost_m <= 0.03 * drawn_m  # who stood still when last looked at is still there


def test_of_vans_that_come_and_go_only_what_no_later_view_meets_from_the_front_is_left():
    scene, lidar = SCENES[1]
    assert ghosts_m(scene, lidar, "evidence")[0] <= 0.05 * ghosts_m(scene, lidar, "off")[0]


@pytest.mark.parametrize(("scene", "lidar"), SCENES)
def test_no_wall_is_lost_to_what_moved_before_it(scene, lidar):
    shown = {}
    for method in ("off", "evidence"):
        points, simulation = finished(scene, lidar, method)
        middles = cut_surfaces(standing(simulation)).middles
        shown[method] = KDTree(points).query(middles)[0] <= 0.05
    assert np.mean(shown["evidence"]) >= np.mean(shown["off"]) - 0.01
