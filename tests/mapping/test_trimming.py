"""Curves go where nothing was measured: they are cut there, and short gaps are passed over."""

import numpy as np
import pytest

from bsmap_cli.mapping.trimming import remove_guessed
from tests.mapping.walls import STEP, drawn_points, frozen, insert, line, new_map

NOISE = 0.005


def seen_with_gap(gap_m, *, views=5, closed=0):
    """A wall of 4 m with an opening in its middle, which as many views pass over as one cluster.

    In `closed` of the views the opening is filled.
    """
    curve_map, random = new_map(), np.random.default_rng(1)
    parts = [line((0, 0), (2 - 0.5 * gap_m, 0)), line((2 + 0.5 * gap_m, 0), (4, 0))]
    for view in range(views):
        whole = line((0, 0), (4, 0)) if view < closed else np.concatenate(parts)
        insert(curve_map, whole + NOISE * random.normal(size=whole.shape), sigma_m=NOISE)
    return curve_map


def drawn_over(curve_map):
    """Where along the wall anything is drawn, sorted [m]."""
    return np.sort(np.concatenate([drawn_points(curve)[:, 0] for curve in frozen(curve_map)]))


@pytest.mark.parametrize("gap_m", [0.9, 1.5])
def test_no_curve_crosses_an_opening(gap_m):
    curve_map = seen_with_gap(gap_m)
    assert len(frozen(curve_map)) == 1
    remove_guessed(curve_map, min_length=0.75)
    x = drawn_over(curve_map)
    assert len(frozen(curve_map)) == 2
    assert np.diff(x).max() > gap_m - 4 * STEP  # one span at most beside each end, and half its own
    assert x[0] < STEP and x[-1] > 4 - STEP


@pytest.mark.parametrize("gap_m", [0.0, 0.2])
def test_a_wall_stays_whole_past_a_few_lost_beams(gap_m):
    curve_map = seen_with_gap(gap_m)
    before = drawn_over(curve_map)
    remove_guessed(curve_map, min_length=0.75)
    assert np.array_equal(drawn_over(curve_map), before)


def test_what_was_measured_once_is_no_guess():
    curve_map = seen_with_gap(0.9, closed=1)
    before = drawn_over(curve_map)
    remove_guessed(curve_map, min_length=0.75)
    assert np.array_equal(drawn_over(curve_map), before)


def test_a_piece_too_short_to_draw_goes_with_the_guess():
    curve_map = new_map()
    insert(curve_map, np.concatenate((line((0, 0), (2, 0)), line((2.9, 0), (2.95, 0), 0.01))))
    remove_guessed(curve_map, min_length=1.5)
    assert drawn_over(curve_map)[-1] < 2.0 + 3 * STEP
