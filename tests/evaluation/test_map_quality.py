"""Distance to the true surfaces: on maps whose error is known by construction."""

import itertools
import math

import numpy as np
import pytest

from bsmap_cli.evaluation.map_quality import map_quality
from bsmap_cli.evaluation.true_surfaces import cut_surfaces
from bsmap_cli.geometry.se2 import SE2
from tests.maps import arc_points, line_points, make_level

WALL = np.array([[0.0, 0.0], [8.0, 0.0]])


def wall_map(offset_m=0.0, begin=0.9, end=7.1):
    return make_level([line_points((begin, offset_m), (end, offset_m), 0.1)])


def test_a_map_on_the_wall_has_no_error():
    quality = map_quality(wall_map(), cut_surfaces([WALL]))
    assert quality.rms_m < 1e-6
    assert quality.away_rms_m < 1e-6
    # drawn from 1 m to 7 m of 8 m, and 3 cm more at both ends count as covered
    assert quality.coverage == pytest.approx(6.06 / 8.0, abs=0.005)
    assert quality.redundancy == 1.0


def test_a_shifted_map_is_off_by_the_shift():
    quality = map_quality(wall_map(0.004), cut_surfaces([WALL]))
    for figure in (quality.rms_m, quality.p95_m, quality.max_m, quality.away_rms_m):
        assert figure == pytest.approx(0.004, abs=1e-7)


def test_the_map_s_frame_is_moved_into_the_world():
    pose = SE2(3.0, -2.0, 0.7)
    surfaces = cut_surfaces([pose.transform(WALL)])
    assert map_quality(wall_map(), surfaces, pose_world_map=pose).rms_m < 1e-6
    assert map_quality(wall_map(), surfaces).rms_m > 1.0


def test_only_pieces_hit_often_enough_are_asked_for():
    surfaces = cut_surfaces([WALL])
    beams = np.repeat(np.column_stack((np.arange(2.0, 3.0, 0.01), np.full(100, 0.01))), 5, axis=0)
    hits = surfaces.count_hits(beams)
    assert hits.sum() == 500
    assert map_quality(wall_map(), surfaces, hits=hits).coverage == 1.0
    assert map_quality(wall_map(begin=2.4), surfaces, hits=hits).coverage == pytest.approx(
        0.53, abs=0.03
    )
    far = surfaces.count_hits(beams + np.array([0.0, 1.0]))
    assert far.sum() == 0
    assert map_quality(wall_map(), surfaces, hits=far).coverage is None


def test_corners_are_sharp_turns_and_ends_but_not_the_facets_of_an_arc():
    angle = np.linspace(0, np.pi / 2, 30)
    arc = np.column_stack((np.cos(angle), np.sin(angle)))
    box = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]], float) + 5.0
    circle = np.column_stack((np.cos(4 * angle), np.sin(4 * angle))) - 5.0
    corners = cut_surfaces([arc, box, circle]).corners
    expected = [*arc[[0, -1]], *box[:4]]
    assert sorted(np.round(corners, 9).tolist()) == sorted(np.round(expected, 9).tolist())


def test_away_from_corners_is_farther_than_two_knot_steps():
    # a rounded corner: off near it, exact elsewhere
    points = np.concatenate((line_points((0, 0), (4, 0), 0.1), line_points((4, 0.1), (4, 4), 0.1)))
    surfaces = cut_surfaces([np.array([[-5.0, 0], [4, 0], [4, 9]])])
    quality = map_quality(make_level([points]), surfaces)
    assert quality.away_rms_m < 1e-6
    assert quality.rms_m > 1e-4


def test_distance_beside_the_naive_one():
    rng = np.random.default_rng(0)
    polylines = [np.cumsum(rng.normal(0, 0.3, (6, 2)), axis=0) + rng.normal(0, 1, 2) for _ in "abc"]
    points = rng.uniform(-2, 2, (60, 2))

    def naive(p):
        best = math.inf
        for line in polylines:
            for a, b in itertools.pairwise(line):
                f = min(max(np.dot(p - a, b - a) / np.dot(b - a, b - a), 0), 1)
                best = min(best, math.dist(p, a + f * (b - a)))
        return best

    expected = [naive(p) for p in points]
    np.testing.assert_allclose(cut_surfaces(polylines).distances(points), expected, atol=1e-4)


def test_a_circle_of_control_points_runs_inside_by_what_theory_says():
    level = make_level([arc_points((0, 0), 0.5, 0, 2 * np.pi, 0.1)])
    angle = np.linspace(0, 2 * np.pi, 2000)
    circle = 0.5 * np.column_stack((np.cos(angle), np.sin(angle)))
    quality = map_quality(level, cut_surfaces([circle]))
    assert quality.rms_m == pytest.approx(0.1**2 / (6 * 0.5), rel=0.05)


def test_an_empty_map_has_no_quality():
    assert map_quality(make_level([]), cut_surfaces([WALL])) is None
