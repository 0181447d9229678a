"""A robot in a known map: found from anywhere, not where it could be elsewhere, found again."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bsmap_cli.errors import MapFileError
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.mapping.mapper import Mapper
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.sensor.simulator.simulation import simulate
from bsmap_cli.slam.known_map import settings_for_map
from bsmap_cli.slam.localization import Localizer
from bsmap_cli.slam.slam import Slam
from bsmap_cli.slam.slam_settings import SlamSettings
from tests.maps import room_document

DEFAULT = SlamSettings()
DATA = Path(__file__).parent.parent.parent.parent / "shared" / "data"


def mapped(sim, scans=None, settings=MappingSettings()):  # noqa: B008 (frozen)
    """The finest level of a map in the world frame, from true poses."""
    mapper = Mapper(settings)
    for scan, pose in zip(list(sim.scans())[:scans], sim.truth.poses, strict=False):
        mapper.insert(scan, SE2.from_array(pose))
    document = mapper.document()
    return replace(document, levels=document.levels[-1:])


def localized(document, scans, settings=DEFAULT):
    localizer = Localizer(document, settings)
    for scan in scans:
        localizer.process(scan)
    return localizer.finish()


def errors(found, true):
    """(m,) metres and (m,) degrees in the frame of the map: nothing is aligned."""
    turn = np.remainder(found[:, 2] - true[:, 2] + math.pi, math.tau) - math.pi
    return np.hypot(*(found - true)[:, :2].T), np.degrees(np.abs(turn))


@pytest.fixture(scope="module")
def shapes():
    return mapped(simulate("shapes", seed=1, rate_hz=3.0))


@pytest.fixture(scope="module")
def loop():
    """A map of the first half of the ring, and a run twice round it."""
    sim = simulate("loop", lidar="lms200", seed=3, rate_hz=2.5, noise_m=0.01)
    return mapped(simulate("loop", lidar="lms200", seed=1, rate_hz=2.5), 170), sim


@pytest.mark.parametrize("odometry", [True, False])
@pytest.mark.parametrize("start", [0, 31, 77])
def test_a_robot_is_found_wherever_it_starts(start, odometry, shapes):
    sim = simulate("shapes", seed=2, rate_hz=3.0, noise_m=0.01, odometry=odometry)
    found = localized(shapes, list(sim.scans())[start:])
    assert found.converged_after_scans <= 10
    assert found.lost_scans == 0
    metres, degrees = errors(found.trajectory.poses, sim.truth.poses[start:])
    assert metres.max() < 0.02
    assert degrees.max() < 0.5
    assert np.array_equal(found.trajectory.stamps_ns, sim.truth.stamps_ns[start:])


def test_the_map_stays_as_it_is(shapes):
    before = shapes.finest.control_points.copy()
    localized(shapes, list(simulate("shapes", seed=2, rate_hz=3.0).scans())[:10])
    assert np.array_equal(shapes.finest.control_points, before)


def test_twin_rooms_are_told_apart_only_once_the_robot_has_seen_more():
    sim = simulate("twins", lidar="lms200", seed=1, rate_hz=3.0)
    scans = list(sim.scans())
    document = mapped(sim)
    late = []
    for start in (0, 110, 220):
        found = localized(document, scans[start:])
        assert found.converged_after_scans is not None
        late.append(found.converged_after_scans)
        metres, _ = errors(found.trajectory.poses, sim.truth.poses[start:])
        assert metres.max() < 0.1, start
    assert max(late) > 10  # some starts lie in a room


def test_bare_walls_have_no_place():
    sim = simulate("corridor", seed=1, rate_hz=4.0)
    found = localized(mapped(sim), list(sim.scans())[60:90])
    assert found.converged_after_scans is None
    assert len(found.trajectory) == 30


def test_a_map_of_elsewhere_has_no_place_either(shapes):
    scans = list(simulate("wall", seed=1, rate_hz=4.0).scans())[:30]
    assert localized(shapes, scans).converged_after_scans is None


def test_a_robot_that_is_carried_off_is_found_again(loop):
    document, sim = loop
    scans, order = list(sim.scans()), [*range(20, 50), *range(120, 160)]
    found = localized(document, [replace(scans[k], pose_odom_base=None) for k in order])
    metres, _ = errors(found.trajectory.poses, sim.truth.poses[order])
    assert metres[8:30].max() < 0.1  # for two seconds its speed is not known
    assert 0 < found.lost_scans < 35
    assert (metres[30:] > 0.1).sum() <= found.lost_scans + 4  # three to notice, and one to search
    assert metres[-10:].max() < 0.1


def test_poses_bridge_what_lies_outside_of_the_map(loop):
    document, sim = loop
    found = localized(document, list(sim.scans())[100:400])
    assert found.converged_after_scans < 40
    metres, degrees = errors(found.trajectory.poses, sim.truth.poses[100:400])
    assert 40 < found.lost_scans < 200
    assert metres.max() < 1.0
    assert degrees.max() < 3.0
    assert np.percentile(metres[-50:], 90) < 0.05


def test_a_robot_finds_itself_where_boxes_were_moved():
    sim = simulate("changes", seed=1, rate_hz=4.0)
    scans, half = list(sim.scans()), len(sim) // 2
    found = localized(mapped(sim, half), scans[half + 20 :])
    metres, _ = errors(found.trajectory.poses, sim.truth.poses[half + 20 :])
    assert np.percentile(metres, 90) < 0.03
    assert metres.max() < 0.1


def test_the_map_decides_degree_and_ladder():
    coarse = settings_for_map(DEFAULT, replace(room_document(0.25), degree=4))
    assert coarse.ladder == pytest.approx((1.0, 0.5, 0.25))
    assert coarse.degree == 4
    assert settings_for_map(DEFAULT, room_document(0.1)).ladder == DEFAULT.ladder


def test_a_coarse_map_is_enough():
    settings = MappingSettings(ladder=(0.4, 0.2))
    document = mapped(simulate("shapes", seed=1, rate_hz=3.0), settings=settings)
    sim = simulate("shapes", seed=2, rate_hz=3.0)
    found = localized(document, list(sim.scans())[40:])
    metres, _ = errors(found.trajectory.poses, sim.truth.poses[40:])
    assert metres.max() < 0.05


def test_a_map_without_curves_is_refused():
    room = room_document()
    blank = replace(room.finest, weights=np.zeros_like(room.finest.weights))
    with pytest.raises(MapFileError, match="nothing to find"):
        Localizer(replace(room, levels=(blank,)), DEFAULT)


def test_no_scan_has_no_place(shapes):
    found = localized(shapes, [])
    assert found.converged_after_scans is None
    assert len(found.trajectory) == 0


@pytest.mark.skipif(not DATA.is_dir(), reason="no real logs in ../shared/data")
def test_a_real_robot_is_found_from_the_middle_of_its_log():
    with open_log([str(DATA / "mit-csail.clf.gz")], ReadOptions(end_s=70.0)) as reader:
        scans = list(reader.scans())
    slam = Slam(DEFAULT)
    for scan in scans:
        slam.process(scan)
    made = slam.finish()
    start = len(scans) // 2
    found = localized(replace(made.document, levels=made.document.levels[-1:]), scans[start:])
    assert found.converged_after_scans < 30
    metres, degrees = errors(found.trajectory.poses, made.trajectory.poses[start:])
    assert np.percentile(metres, 95) < 0.1
    assert np.percentile(degrees, 95) < 2.0
