"""Go on with an old map: one frame, nothing twice, what is new added, what has gone removed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bsmap_cli.errors import TrackingError
from bsmap_cli.evaluation.redundancy import redundancy
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.sampling import sample_level
from bsmap_cli.sensor.simulator.simulation import simulate
from bsmap_cli.slam.known_map import KnownMap, settings_for_map
from bsmap_cli.slam.slam import Slam
from bsmap_cli.slam.slam_settings import SlamSettings
from tests.maps import make_level
from tests.slam.test_localization import DATA, errors

DEFAULT = SlamSettings()


def run(scans, old=None, settings=DEFAULT):
    if old is not None:
        settings = settings_for_map(settings, old)
    slam = Slam(settings, KnownMap(old, settings) if old is not None else None)
    for scan in scans:
        slam.process(scan)
    return slam.finish()


def in_frame_of(first, poses):
    """(n, 3) poses of the world as seen from one of them."""
    inverse = SE2.from_array(first).inverse()
    return np.array([(inverse @ SE2.from_array(pose)).as_array() for pose in poses])


def length_m(document):
    samples = sample_level(document.finest, 0.01)
    steps = np.hypot(*np.diff(samples.points, axis=0).T)
    return float(steps[np.diff(samples.piece) == 0].sum())


HALF, OVERLAP = 280, 40  # scans of the first part of the ring, and of those that both have seen


@pytest.fixture(scope="module")
def loop():
    """A run once round a ring of corridors."""
    return simulate("loop", seed=1, rate_hz=4.0, noise_m=0.01)


@pytest.fixture(scope="module")
def first_half(loop):
    return run(list(loop.scans())[:HALF])


@pytest.mark.parametrize("odometry", [True, False])
def test_the_second_half_of_a_log_extends_the_map_of_the_first(odometry, loop, first_half):
    begin, end = HALF - OVERLAP, 2 * HALF
    scans = list(loop.scans())[begin:end]
    scans = [scan if odometry else replace(scan, pose_odom_base=None) for scan in scans]
    result = run(scans, first_half.document)
    truth = in_frame_of(loop.truth.poses[0], loop.truth.poses)
    metres, degrees = errors(result.trajectory.poses, truth[begin:end])
    assert np.sqrt(np.mean(metres**2)) <= 0.05
    assert np.percentile(degrees, 95) < 0.5
    whole = run(list(loop.scans())[:end])
    assert length_m(first_half.document) < 0.7 * length_m(whole.document)
    assert length_m(result.document) == pytest.approx(length_m(whole.document), rel=0.03)
    assert redundancy(result.document.finest) <= 1.05


def test_the_same_way_again_draws_nothing_twice(first_half):
    again = simulate("loop", seed=2, rate_hz=4.0, noise_m=0.01)
    result = run(list(again.scans())[:HALF], first_half.document)
    assert length_m(result.document) == pytest.approx(length_m(first_half.document), rel=0.03)
    assert redundancy(result.document.finest) <= 1.05


def near_m(document, points):
    """(m,) distance of points to the nearest sample of the map."""
    samples = sample_level(document.finest, 0.02).points
    return np.array([np.hypot(*(samples - point).T).min() for point in points])


def test_what_has_gone_goes_from_the_old_map_and_what_came_enters_it():
    sim = simulate("changes", seed=1, rate_hz=4.0)
    scans, half = list(sim.scans()), len(sim) // 2
    before = run(scans[: half - 1])
    after = run(scans[half + 5 :], before.document)
    origin = SE2.from_array(sim.truth.poses[0])
    # the fronts of the box that was taken away, and of the one that was put there
    gone = SE2(5.6, 5.5, 0.1).transform(np.array([[-0.3, -0.35], [0.0, -0.35], [0.3, -0.35]]))
    came = SE2(0.6, 3.0, 0.3).transform(np.array([[0.4, -0.2], [0.4, 0.0], [0.4, 0.2]]))
    gone, came = origin.inverse().transform(gone), origin.inverse().transform(came)
    assert near_m(before.document, gone).max() < 0.05
    assert near_m(before.document, came).min() > 0.3
    assert near_m(after.document, gone).min() > 0.2
    assert near_m(after.document, came).max() < 0.05


@pytest.mark.parametrize("scene", ["wall", "shapes", "corridor"])
def test_a_log_of_elsewhere_is_refused(scene, first_half):
    scans = list(simulate(scene, seed=1, rate_hz=3.0).scans())[:80]
    with pytest.raises(TrackingError, match="no place in the old map, or more than one"):
        run(scans, first_half.document)


def test_a_square_room_has_four_places():
    """Which of its walls the robot sees, nothing tells."""
    side = np.arange(0.0, 6.05, 0.1)
    low, high = np.zeros_like(side), np.full_like(side, 6.0)
    walls = [
        np.stack(wall, axis=1)
        for wall in ((side, low), (high, side), (side[::-1], high), (low, side[::-1]))
    ]
    square = MapDocument(degree=3, max_weight=50, levels=(make_level(walls),))
    sim = simulate("spin", seed=1, rate_hz=5.0)
    scans = []
    for scan in list(sim.scans())[:20]:
        angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(len(scan.ranges_m))
        with np.errstate(divide="ignore"):
            reach = 3.0 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
        scans.append(replace(scan, ranges_m=reach.astype(np.float32), pose_odom_base=None))
    with pytest.raises(TrackingError, match="more than one"):
        run(scans, square)


def test_two_runs_give_the_same_bytes(loop, first_half):
    scans = list(loop.scans())[100:180]
    one, two = run(scans, first_half.document), run(scans, first_half.document)
    assert np.array_equal(one.trajectory.poses, two.trajectory.poses)
    assert np.array_equal(one.document.finest.control_points, two.document.finest.control_points)


@pytest.mark.skipif(not DATA.is_dir(), reason="no real logs in ../shared/data")
def test_a_real_log_goes_on_where_it_was_cut_in_two():
    with open_log([str(DATA / "mit-csail.clf.gz")], ReadOptions(end_s=110.0)) as reader:
        scans = list(reader.scans())
    cut, begin = len(scans) // 2, len(scans) // 3
    first, whole = run(scans[:cut]), run(scans)
    both = run(scans[begin:], first.document)
    here = in_frame_of(first.trajectory.poses[0], both.trajectory.poses)
    there = in_frame_of(whole.trajectory.poses[0], whole.trajectory.poses)[begin:]
    metres, degrees = errors(here, there)
    assert np.percentile(metres, 95) < 0.15
    assert np.percentile(degrees, 95) < 1.5
    assert length_m(both.document) == pytest.approx(length_m(whole.document), rel=0.05)
    assert redundancy(both.document.finest) <= 1.05
