"""Where one map lies in another."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from bsmap_cli.errors import MapFileError
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.sampling import sample_level
from bsmap_cli.slam.map_placing import MapPlacer
from bsmap_cli.slam.slam_settings import SlamSettings
from tests.maps import line_points, make_level, room_document

DEFAULT, ROOM = SlamSettings(), room_document()
POSES = [SE2(0.0, 0.0, 0.0), SE2(7.0, -3.0, 2.0), SE2(-200.0, 90.0, -3.1), SE2(0.3, 0.1, 1.6)]


def moved(document, pose):
    return replace(document, levels=tuple(level.moved(pose) for level in document.levels))


def assert_near(found, pose, metres=1e-3):
    gap = found.inverse() @ pose
    assert math.hypot(gap.x, gap.y) < metres
    assert abs(gap.theta) < 1e-3


def drawn_m(document):
    """Metres of all drawn pieces, from chords of 1 mm."""
    samples = sample_level(document.finest, 1e-3)
    ways = np.hypot(*np.diff(samples.points, axis=0).T)
    return ways[np.diff(samples.piece) == 0].sum()


def square():
    corners = [(0.0, 0.0), (5.0, 0.0), (5.0, 5.0), (0.0, 5.0), (0.0, 0.0)]
    walls = [line_points(a, b, 0.1) for a, b in itertools.pairwise(corners)]
    return MapDocument(degree=3, max_weight=50, levels=(make_level(walls),))


@pytest.mark.parametrize("pose", POSES)
def test_a_map_is_found_in_itself_whatever_its_frame(pose):
    found = MapPlacer(ROOM, moved(ROOM, pose.inverse()), DEFAULT).search()
    assert found is not None
    assert_near(found.pose_a_b, pose, 1e-4 + 1e-6 * math.hypot(pose.x, pose.y))
    assert found.overlap_m == pytest.approx(drawn_m(ROOM), rel=1e-3), "each metre counts once"
    assert found.aside_m < 0.5
    assert found.refined


def test_the_knot_steps_may_differ():
    pose = SE2(2.0, 1.0, 0.7)
    found = MapPlacer(ROOM, moved(room_document(0.2), pose.inverse()), DEFAULT).search()
    assert found is not None
    assert_near(found.pose_a_b, pose, 0.01)


def test_a_square_room_has_four_places_and_a_room_of_elsewhere_none():
    assert MapPlacer(square(), square(), DEFAULT).search() is None
    assert MapPlacer(ROOM, square(), DEFAULT).search() is None


def test_bare_walls_do_not_tell_where_along_them():
    wall = MapDocument(
        degree=3, max_weight=50, levels=(make_level([line_points((0, 0), (9, 0), 0.1)]),)
    )
    assert MapPlacer(wall, wall, DEFAULT).search() is None


@pytest.mark.parametrize("off", [SE2(0.0, 0.0, 0.0), SE2(1.2, -0.8, 0.2), SE2(-0.9, 0.9, -0.3)])
def test_a_pose_given_by_hand_is_refined(off):
    pose = SE2(7.0, -3.0, 2.0)
    found = MapPlacer(ROOM, moved(ROOM, pose.inverse()), DEFAULT).near(pose @ off)
    assert found.refined
    assert_near(found.pose_a_b, pose)


def test_it_decides_which_of_four_places_it_is():
    turned = SE2(5.0, 0.0, 0.5 * math.pi)
    found = MapPlacer(square(), square(), DEFAULT).near(SE2(5.1, 0.2, 1.5))
    assert_near(found.pose_a_b, turned)


def test_where_nothing_overlaps_it_is_taken_as_it_is():
    far = SE2(100.0, 0.0, 1.0)
    found = MapPlacer(ROOM, ROOM, DEFAULT).near(far)
    assert (found.overlap_m, found.refined) == (0.0, False)
    assert_near(found.pose_a_b, far, 1e-9)


@pytest.mark.parametrize("which", [0, 1])
def test_a_map_that_draws_nothing_is_refused(which):
    blank = replace(ROOM.finest, weights=np.zeros_like(ROOM.finest.weights))
    maps = [ROOM, ROOM]
    maps[which] = replace(ROOM, levels=(blank,))
    with pytest.raises(MapFileError, match="draws no curve"):
        MapPlacer(*maps, DEFAULT)
