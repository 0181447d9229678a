"""A finished level is tidied: what is drawn twice goes, what follows on is joined."""

import numpy as np
import pytest

from bsmap_cli.mapping.cleanup import cut_curve, tidy
from tests.mapping.walls import (
    MATRIX,
    STEP,
    arc,
    drawn_points,
    frozen,
    insert,
    line,
    new_map,
    speeds,
)

VIEWS = 20
MILLIMETRE = 1e-3


def map_of(*parts):
    """Each part a curve of its own, seen often."""
    curve_map = new_map()
    for part in parts:
        alone = len(curve_map)
        insert(curve_map, part)
        assert len(curve_map) == alone + 1
    for _ in range(VIEWS - 1):
        insert(curve_map, *parts)
    return curve_map


def moved(curve_map, curve, by):
    """The map with one curve somewhere else."""
    arrays = curve_map.arrays
    rows = slice(int(arrays.offset[curve]), int(arrays.offset[curve] + arrays.count[curve]))
    arrays.points[rows] += by
    curve_map.reindex()
    return curve_map


def tidied(curve_map):
    tidy(curve_map, min_length=0.75)
    return frozen(curve_map)


def test_a_curve_goes_on_where_another_ends():
    (curve,) = tidied(map_of(line((0, 0), (1.23, 0)), line((1.3, 0), (3.04, 0))))
    points = drawn_points(curve)
    assert points[[0, -1], 0] == pytest.approx([0.0, 3.04], abs=2 * MILLIMETRE)
    assert np.abs(points[:, 1]).max() < 0.1 * MILLIMETRE
    assert np.abs(speeds(curve) - 1.0).max() < 0.02
    weights = curve.weights[3:-3]
    assert np.median(weights) == pytest.approx(VIEWS, rel=0.05)
    assert weights.min() > 0.25 * VIEWS  # the ends that met had been seen in part


@pytest.mark.parametrize("cut_u", [10.0, 10.05, 10.5, 10.95])
@pytest.mark.parametrize("gap_m", [0.0, 0.03, 0.07])
def test_what_was_cut_off_does_not_come_back(cut_u, gap_m):
    """The first curve turned away behind the cut: there it goes on as the second one does."""
    turned = np.concatenate((line((0, 0), (1.25, 0)), arc((1.25, 0.3), 0.3, -1.57, 0.0)))
    curve_map = map_of(turned, line((1.0 + gap_m, -2.0), (2.5, -2.0)))
    cut_curve(curve_map.arrays, MATRIX, STEP, 0, 0.0, cut_u)
    (curve,) = tidied(moved(curve_map, 1, (0.1 * cut_u - 1.0, 2.0)))
    points = drawn_points(curve)
    assert np.abs(points[:, 1]).max() < 0.5 * MILLIMETRE
    assert points[-1, 0] == pytest.approx(1.5 + 0.1 * cut_u, abs=2 * MILLIMETRE)
    assert np.abs(speeds(curve) - 1.0).max() < 0.05


def test_what_both_have_beside_the_seam_stays():
    """Corners too, but for what a corner loses where the knots lie elsewhere: 0.03 knot steps."""
    first = np.concatenate((line((-1, 1), (-1, 0)), line((-1, 0), (0.51, 0))))
    second = np.concatenate((line((0.55, -2), (2, -2)), line((2, -2), (2, -1))))
    curve_map = moved(map_of(first, second), 1, (0.0, 2.0))
    before = [drawn_points(curve) for curve in frozen(curve_map)]
    (curve,) = tidied(curve_map)
    after = drawn_points(curve, 4000)
    for points in before:
        away = np.hypot(*(points[:, None] - after).T).min(axis=0)
        assert away.max() < 0.03 * STEP


def test_ends_that_turn_away_or_lie_aside_are_not_joined():
    first = line((0, 0), (1, 0))
    turned = moved(map_of(first, line((1, -2), (1, -1))), 1, (0.0, 2.02))
    aside = moved(map_of(first, line((1.05, -2), (2, -2))), 1, (0.0, 2.04))
    for curve_map in (turned, aside):
        assert len(tidied(curve_map)) == 2


def test_a_lighter_curve_gives_way_where_a_heavier_one_runs():
    curve_map = map_of(line((0, 0), (2, 0)), line((0.5, 1.02), (1.5, 1.02)))
    (curve,) = tidied(moved(curve_map, 1, (0.0, -1.0)))
    assert np.abs(drawn_points(curve)[:, 1]).max() < 0.1 * MILLIMETRE
