"""What two maps do not share, against rooms whose changes are known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.evaluation.map_difference import map_difference
from bsmap_cli.evaluation.pose_arrays import transform_poses
from bsmap_cli.geometry.se2 import SE2
from tests.maps import line_points, make_level, room_document

ROOM, HERE = room_document(), SE2.identity()
DRAWN = 2 * (6.0 + 4.0) - 4 * 0.2 + math.tau * 0.5 - 0.2  # a curve ends a knot step from its points


def moved(document, pose):
    levels = tuple(level.moved(pose) for level in document.levels)
    path = transform_poses(pose, document.path.astype(float)).astype(np.float32)
    return replace(document, levels=levels, path=path)


def without(document, curve):
    """The map without one of its curves."""
    level = document.finest
    kept = [k for k in range(len(level)) if k != curve]
    rows = np.concatenate([np.arange(*level.offsets()[k : k + 2]) for k in kept])
    names = ("curve_ids", "tau_start_m", "tau_end_m", "flags", "observations", "first_indices")
    level = replace(
        level,
        **{name: getattr(level, name)[kept] for name in (*names, "point_counts")},
        control_points=level.control_points[rows],
        weights=level.weights[rows],
    )
    return replace(document, levels=(level,))


def test_a_map_does_not_differ_from_itself():
    found = map_difference(ROOM, ROOM, HERE)
    assert (found.added_m, found.removed_m, found.rms_m, found.segments) == (0.0, 0.0, 0.0, ())
    assert found.common_m == pytest.approx(DRAWN, abs=0.05)
    assert found.tolerance_m == 0.1


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(-math.pi, math.pi))
@settings(max_examples=20, deadline=None)
def test_nor_from_itself_in_another_frame(x, y, theta):
    pose = SE2(x, y, theta)
    found = map_difference(ROOM, moved(ROOM, pose.inverse()), pose)
    assert (found.added_m, found.removed_m, found.unseen_m) == (0.0, 0.0, 0.0)
    assert found.rms_m < 1e-4


@pytest.mark.parametrize("curve", range(5))
def test_what_one_map_lacks_is_added_or_not_there(curve):
    less = without(ROOM, curve)
    gone, added = map_difference(ROOM, less, HERE), map_difference(less, ROOM, HERE)
    gone_m = gone.removed_m + gone.unseen_m
    assert gone.added_m == added.removed_m == added.unseen_m == 0.0
    assert gone_m == pytest.approx(added.added_m, abs=0.05)
    length = [5.8, 3.8, 5.8, 3.8, math.tau * 0.5 - 0.2][curve]
    assert gone_m == pytest.approx(length, abs=0.25)  # less what the corners hide
    assert gone.common_m + gone_m == pytest.approx(DRAWN, abs=0.05)
    # behind the pillar there are walls to be seen, behind a wall there is nothing
    assert {stretch.change for stretch in gone.segments} == {"removed" if curve == 4 else "unseen"}
    assert {stretch.curve_id for stretch in gone.segments} == {curve + 1}


def test_without_a_path_nothing_is_known_to_be_removed():
    gone = map_difference(ROOM, replace(without(ROOM, 4), path=ROOM.path[:0]), HERE)
    assert gone.removed_m == 0.0
    assert gone.unseen_m == pytest.approx(math.tau * 0.5 - 0.2, abs=0.05)


@pytest.mark.parametrize("pose", [HERE, SE2(12.0, -7.0, 2.5)])
def test_a_wall_of_which_one_half_is_out_of_sight(pose):
    """It ran through the room and on behind the wall at x = 6, of which the later map knows."""
    before = replace(
        ROOM, levels=(ROOM.finest, make_level([line_points((3.0, 3.2), (9.0, 3.2), 0.1)]))
    )
    before = replace(before, parts=True)
    found = map_difference(before, moved(ROOM, pose.inverse()), pose)
    assert found.added_m == 0.0
    assert found.removed_m == pytest.approx(2.9, abs=0.2)
    assert found.unseen_m == pytest.approx(2.9, abs=0.2)
    removed, unseen = sorted(found.segments, key=lambda stretch: stretch.points[0, 0])
    assert (removed.change, unseen.change) == ("removed", "unseen")
    assert removed.points[-1] == pytest.approx([6.0, 3.2], abs=0.15)


def missing(found):
    return found.removed_m + found.unseen_m


def test_coordinates_are_in_the_frame_of_the_first():
    pose = SE2(3.0, -1.0, 2.0)
    box = make_level([line_points((2.0, 1.0), (3.0, 1.0), 0.1)])
    with_box = replace(ROOM, levels=(ROOM.finest, box), parts=True)
    found = map_difference(ROOM, moved(with_box, pose.inverse()), pose)
    (stretch,) = found.segments
    assert stretch.change == "added"
    assert stretch.points[[0, -1]] == pytest.approx(np.array([[2.1, 1.0], [2.9, 1.0]]), abs=1e-4)
    assert found.as_json()["segments"][0]["length_m"] == pytest.approx(0.8, abs=1e-3)


def shifted(aside_m, reverse=False, length=3.0):
    """A wall, and the same wall so far aside."""
    ends = [(0.0, aside_m), (length, aside_m)]
    wall = line_points((0.0, 0.0), (3.0, 0.0), 0.1)
    other = line_points(*(ends[::-1] if reverse else ends), 0.1)
    documents = [replace(ROOM, levels=(make_level([points]),)) for points in (wall, other)]
    return map_difference(*documents, HERE)


@pytest.mark.parametrize("aside_m", [0.0, 0.03, 0.09])
def test_within_the_tolerance_curves_are_the_same_and_rms_tells_how_far(aside_m):
    found = shifted(aside_m)
    assert (found.added_m, missing(found)) == (0.0, 0.0)
    assert found.rms_m == pytest.approx(aside_m, abs=1e-4)


def test_beyond_it_both_change_and_the_other_face_of_a_wall_is_no_match():
    for found in (shifted(0.12), shifted(0.05, reverse=True)):
        assert found.added_m == pytest.approx(2.8, abs=1e-3)
        assert missing(found) == pytest.approx(2.8, abs=1e-3)
        assert found.common_m == pytest.approx(0.0, abs=1e-3)


def test_a_stretch_shorter_than_three_tolerances_is_noise():
    assert missing(shifted(0.0, length=2.7)) == 0.0
    assert missing(shifted(0.0, length=2.5)) == pytest.approx(0.4, abs=0.06)


def test_the_wider_knot_step_is_the_tolerance():
    coarse = room_document(0.2)
    assert map_difference(ROOM, coarse, HERE).tolerance_m == 0.2
    assert map_difference(ROOM, ROOM, HERE, tolerance_m=0.02).tolerance_m == 0.02


def test_few_pairs_at_a_time_tell_the_same(monkeypatch):
    aside = moved(without(ROOM, 1), SE2(0.03, -0.02, 0.01))
    whole = map_difference(ROOM, aside, HERE).as_json()
    monkeypatch.setattr("bsmap_cli.geometry.near_pairs.MOST_PAIRS", 500.0)
    assert map_difference(ROOM, aside, HERE).as_json() == whole


def test_maps_that_draw_nothing_have_nothing_in_common():
    blank = replace(ROOM.finest, weights=np.zeros_like(ROOM.finest.weights))
    nothing = replace(ROOM, levels=(blank,))
    found = map_difference(nothing, ROOM, HERE)
    assert found.added_m == pytest.approx(DRAWN, abs=0.05)
    assert (found.removed_m, found.common_m, found.rms_m) == (0.0, 0.0, 0.0)
    assert map_difference(nothing, nothing, HERE).segments == ()
