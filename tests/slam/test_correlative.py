"""Branch and bound against a search through every pose of the window."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.slam import wide_search
from bsmap_cli.slam.likelihood import CHANNELS, Likelihood, _fill_pyramid, build_likelihood
from bsmap_cli.slam.search_window import Window
from tests.mapping.walls import new_map
from tests.slam.rooms import CENTRE, map_of, room_parts, seen_from

seeds = st.integers(0, 2**32)
ROOM = map_of(room_parts())
ENGINES = pytest.mark.parametrize("few", [math.inf, 0], ids=["by angle", "by blocks of angles"])


def search(*asked, few=wide_search.FEW_BLOCKS, **rest):
    """The search, with so many blocks asked one by one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wide_search, "FEW_BLOCKS", few)
        return wide_search.search(*asked, **rest)


def naive_score(likelihood, points, tangents, pose):
    """Mean likelihood of the points at one pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    turn = np.array([[cos, sin], [-sin, cos]])
    placed = (points @ turn + pose[:2] - likelihood.origin_m) / likelihood.cell_m
    columns, rows = np.floor(placed).astype(int).T
    ahead = tangents @ turn
    channels = np.floor(np.arctan2(ahead[:, 1], ahead[:, 0]) / (math.pi / 2) + 0.5).astype(int)
    grid = likelihood.grids[0]
    inside = (columns >= 0) & (columns < grid.shape[2]) & (rows >= 0) & (rows < grid.shape[1])
    values = grid[
        channels % CHANNELS, rows.clip(0, grid.shape[1] - 1), columns.clip(0, grid.shape[2] - 1)
    ]
    return float(np.where(inside, values, 0).sum() / (255.0 * len(points)))


def window_angles(points, likelihood, window):
    """The angles that the search tries: the farthest point moves by a cell from one to the next."""
    radius = np.hypot(*points.T).max()
    turn = likelihood.cell_m / max(radius, 4.0 * likelihood.cell_m)
    steps = math.ceil(min(window.reach_rad, math.pi) / turn)
    return window.centre[2] + np.arange(-steps, steps + 1) * turn


def exhaustive(likelihood, points, tangents, window, allowed=lambda pose: True):
    """Best score of all poses of the window."""
    reach = math.ceil(window.reach_m / likelihood.cell_m)
    best = 0.0
    for angle in window_angles(points, likelihood, window):
        for dx in range(-reach, reach + 1):
            for dy in range(-reach, reach + 1):
                shift = likelihood.cell_m * np.array([dx, dy])
                pose = np.array([*(window.centre[:2] + shift), angle])
                if allowed(pose):
                    best = max(best, naive_score(likelihood, points, tangents, pose))
    return best


def random_likelihood(random, heights):
    """A grid of a few random bumps with its pyramid, padded as the builder does."""
    pad, size = 1 << (heights - 1), int(random.integers(4, 14))
    grids = np.zeros((heights, CHANNELS, pad + size + 1, pad + size + 3), np.uint8)
    inside = grids[0, :, pad:, pad:]
    inside[:] = random.integers(0, 256, inside.shape) * (random.random(inside.shape) < 0.2)
    _fill_pyramid(grids)
    return Likelihood(grids, random.uniform(-1.0, 1.0, 2), 0.1)


@given(seeds, st.integers(1, 6))
@settings(max_examples=40, deadline=None)
def test_pyramid_holds_the_largest_value_of_each_window(seed, heights):
    likelihood = random_likelihood(np.random.default_rng(seed), heights)
    for h in range(heights):
        width = 1 << h
        for k in range(CHANNELS):
            for r in range(0, likelihood.grids.shape[2], 3):
                for c in range(0, likelihood.grids.shape[3], 3):
                    block = likelihood.grids[0, k, r : r + width, c : c + width]
                    assert likelihood.grids[h, k, r, c] == block.max()


@given(seeds, st.integers(1, 5))
@settings(max_examples=40, deadline=None)
def test_every_surface_lies_inside_the_padded_grid(seed, heights):
    random = np.random.default_rng(seed)
    shift = random.uniform(-100.0, 100.0, 2)
    likelihood = build_likelihood(
        map_of([part + shift for part in room_parts()], times=1), cell_m=0.2, heights=heights
    )
    occupied = np.argwhere(likelihood.grids[0].max(axis=0) > 0)
    assert occupied.min() >= 1 << (heights - 1)
    on_wall = np.array([[3.0, 0.0], [0.0, 2.0]]) + shift
    for point, direction in zip(on_wall, ((1.0, 0.0), (0.0, -1.0)), strict=True):
        pose = np.array([*point, 0.0])
        score = naive_score(likelihood, np.zeros((1, 2)), np.array([direction]), pose)
        assert score > 0.75
        assert naive_score(likelihood, np.zeros((1, 2)), -np.array([direction]), pose) == 0.0


def test_an_empty_map_is_unlikely_everywhere():
    likelihood = build_likelihood(new_map(), cell_m=0.1, heights=3)
    points = np.random.default_rng(1).uniform(5.0, 9.0, (20, 2))
    window = Window(np.zeros(3), 1.0, 0.1)
    assert search(likelihood, points, np.eye(2)[[0] * 20], window, floor=0.1) is None


@ENGINES
@given(
    seed=seeds, heights=st.integers(1, 5), reach_m=st.floats(0.0, 0.7), reach_rad=st.floats(0, 0.4)
)
@settings(max_examples=30, deadline=None)
def test_branch_and_bound_equals_exhaustive_search(few, seed, heights, reach_m, reach_rad):
    random = np.random.default_rng(seed)
    likelihood = random_likelihood(random, heights)
    points = random.uniform(-0.6, 0.6, (int(random.integers(1, 12)), 2))
    angle = random.uniform(-np.pi, np.pi, len(points))
    tangents = np.column_stack((np.cos(angle), np.sin(angle)))
    middle = likelihood.origin_m + 0.05 * np.array(likelihood.grids.shape[:1:-1])
    window = Window(np.array([*middle, random.uniform(-4.0, 4.0)]), reach_m, reach_rad)
    expected = exhaustive(likelihood, points, tangents, window)
    peak = search(likelihood, points, tangents, window, floor=0.0, few=few)
    if expected == 0.0:
        assert peak is None
        return
    assert peak.score == pytest.approx(expected, abs=1e-12)
    off = np.abs(peak.pose[:2] - window.centre[:2])
    assert off.max() <= math.ceil(reach_m / 0.1) * 0.1 + 1e-9


@ENGINES
@given(seed=seeds, heights=st.integers(1, 5))
@settings(max_examples=20, deadline=None)
def test_rival_is_the_best_outside_the_barred_disc(few, seed, heights):
    random = np.random.default_rng(seed)
    likelihood = random_likelihood(random, heights)
    points = random.uniform(-0.6, 0.6, (6, 2))
    tangents = np.tile([1.0, 0.0], (6, 1))
    middle = likelihood.origin_m + 0.05 * np.array(likelihood.grids.shape[:1:-1])
    window = Window(np.array([*middle, random.uniform(-4.0, 4.0)]), 0.5, 0.3)
    peak = search(likelihood, points, tangents, window, floor=0.0)
    if peak is None:
        return

    def allowed(pose):
        near = np.hypot(*(pose[:2] - peak.pose[:2])) < 0.25 - 1e-9
        return not (near and abs(pose[2] - peak.pose[2]) < 0.17)

    expected = exhaustive(likelihood, points, tangents, window, allowed)
    rival = search(
        likelihood, points, tangents, window, floor=0.0, barred=peak, apart_m=0.25, few=few
    )
    assert (0.0 if rival is None else rival.score) == pytest.approx(expected, abs=1e-12)


@ENGINES
def test_a_peak_is_no_rival_of_itself_across_the_seam_of_the_circle(few):
    """All round, the first and the last angle are the same place."""
    clusters = seen_from(CENTRE, room_parts(0.1))
    likelihood = build_likelihood(ROOM, cell_m=0.1, heights=4)
    window = Window(np.add(CENTRE.as_array(), (0.0, 0.0, math.pi)), 0.3, math.pi)
    peak = search(likelihood, clusters.points, clusters.tangents, window, floor=0.5, few=few)
    rival = search(
        likelihood,
        clusters.points,
        clusters.tangents,
        window,
        floor=peak.score / 1.1,
        barred=peak,
        apart_m=1.0,
        few=few,
    )
    assert rival is None


@given(seeds, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
@settings(max_examples=10, deadline=None)
def test_a_scan_is_found_from_far_off(seed, x, y):
    random = np.random.default_rng(seed)
    clusters = seen_from(CENTRE, room_parts(0.1))
    likelihood = build_likelihood(ROOM, cell_m=0.1, heights=5)
    centre = np.add(CENTRE.as_array(), (x, y, random.uniform(-0.3, 0.3)))
    peak = search(
        likelihood, clusters.points, clusters.tangents, Window(centre, 1.2, 0.4), floor=0.5
    )
    assert peak.pose == pytest.approx(CENTRE.as_array(), abs=0.1)
    assert peak.score > 0.8


def test_a_floor_that_nothing_reaches_and_a_scan_of_nothing():
    clusters = seen_from(CENTRE, room_parts(0.1))
    likelihood = build_likelihood(ROOM, cell_m=0.1, heights=4)
    window = Window(CENTRE.as_array(), 0.3, 0.1)
    assert search(likelihood, clusters.points, clusters.tangents, window, floor=0.9999) is None
    assert search(likelihood, np.zeros((0, 2)), np.zeros((0, 2)), window, floor=0.0) is None


@given(seeds, st.integers(4, 6), st.sampled_from([0.3, 1.0, 3.0]), st.sampled_from([0.0, 0.2]))
@settings(max_examples=40, deadline=None)
def test_blocks_of_angles_leave_no_better_pose_out(seed, heights, far_m, floor):
    """A wide search finds as good a pose as asking every angle, and as good a rival."""
    random = np.random.default_rng(seed)
    likelihood = random_likelihood(random, heights)
    points = random.uniform(-far_m, far_m, (int(random.integers(1, 12)), 2))
    angle = random.uniform(-np.pi, np.pi, len(points))
    tangents = np.column_stack((np.cos(angle), np.sin(angle)))
    middle = likelihood.origin_m + 0.05 * np.array(likelihood.grids.shape[:1:-1])
    centre = np.array([*middle, random.uniform(-4.0, 4.0)])
    window = Window(centre, random.uniform(0.0, 3.0), random.uniform(0.0, 4.0))
    asked = (likelihood, points, tangents, window)
    one, two = (search(*asked, floor=floor, few=few) for few in (math.inf, 0))
    assert (two and two.score) == pytest.approx(one and one.score)
    if one is not None:
        rest = {"floor": floor, "barred": one, "apart_m": 0.3}
        one, two = (search(*asked, **rest, few=few) for few in (math.inf, 0))
        assert (two and two.score) == pytest.approx(one and one.score)
