import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.sensor.simulator.grid import grid_of, single_cell
from bsmap_cli.sensor.simulator.raycast import cast_rays, ranges_to
from bsmap_cli.sensor.simulator.world import Shapes, arc, box, circle, gather, polyline
from tests.sensor.oracles import range_to

coordinates = st.floats(-8, 8).map(lambda value: round(value, 3))
angles = st.floats(-4, 4)
segments = st.tuples(coordinates, coordinates, coordinates, coordinates).filter(
    lambda row: math.dist(row[:2], row[2:]) > 0.05
)
arcs = st.tuples(
    coordinates, coordinates, st.floats(0.05, 5), st.floats(-4, 4), st.floats(0.1, math.tau)
)


def cast(grid, origin, directions, reach_m=math.inf):
    ranges = np.full(len(directions), math.inf)
    pose = np.array([[*origin, 0.0]])
    cast_rays(grid, pose, np.asarray(directions, float), reach_m, ranges)
    return ranges


@settings(max_examples=150, deadline=None)
@given(
    st.lists(segments, max_size=8),
    st.lists(arcs, max_size=5),
    st.tuples(coordinates, coordinates),
    st.lists(angles, min_size=1, max_size=12),
    st.sampled_from([0.07, 0.5, 3.0, 100.0]),
)
def test_ranges_are_those_of_the_naive_ray(segments, arcs, origin, directions, cell_m):
    shapes = Shapes(np.array(segments, float).reshape(-1, 4), np.array(arcs, float).reshape(-1, 5))
    ranges = cast(grid_of(shapes, cell_m), origin, directions)
    at_once = cast(single_cell(shapes), origin, directions)
    for index, direction in enumerate(directions):
        expected, doubtful = range_to(shapes, np.array(origin), direction)
        if not doubtful:
            assert ranges[index] == pytest.approx(expected, abs=1e-7)
            assert at_once[index] == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("direction", [0.0, math.pi / 2, math.pi, -math.pi / 2])
@pytest.mark.parametrize("x", [0.0, 0.25, 0.5])
def test_rays_along_the_cell_borders(direction, x):
    room = box(0.0, 0.0, 4.0, 4.0)
    expected = 2.0 - x * math.cos(direction)
    assert ranges_to(room, np.array([x, 0.0]), np.array([direction]))[0] == pytest.approx(expected)


def test_a_joint_of_two_walls_lets_no_ray_through():
    for x, y in np.random.default_rng(3).uniform((15.0, -5.0), (25.0, 5.0), (40, 2)):
        walls = polyline((x - 1.0, y + 3.0), (x, y), (x - 1.0, y - 3.0))
        ranges = ranges_to(walls, np.zeros(2), np.array([math.atan2(y, x)]))
        assert ranges[0] == pytest.approx(math.hypot(x, y), abs=1e-6)


def test_an_arc_is_seen_from_inside_and_through_its_opening():
    bowl = arc(0.0, 0.0, 2.0, 90.0, 180.0)
    ranges = ranges_to(bowl, np.array([4.0, 0.0]), np.array([math.pi, 0.0]))
    assert ranges[0] == pytest.approx(6.0)  # past the missing half, onto the far side
    assert ranges[1] == math.inf
    assert ranges_to(bowl, np.zeros(2), np.array([math.pi]))[0] == pytest.approx(2.0)


def test_reach_ends_a_ray():
    pillar = circle(5.0, 0.0, 1.0)
    assert ranges_to(pillar, np.zeros(2), np.zeros(1), reach_m=4.0001)[0] == pytest.approx(4.0)
    assert ranges_to(pillar, np.zeros(2), np.zeros(1), reach_m=3.9999)[0] == math.inf


def test_nothing_there():
    assert ranges_to(gather(()), np.zeros(2), np.array([0.3]))[0] == math.inf


def test_each_beam_from_its_own_pose():
    poses = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, math.pi]])
    ranges = np.full(2, math.inf)
    cast_rays(grid_of(box(0.0, 0.0, 6.0, 6.0)), poses, np.zeros(2), math.inf, ranges)
    assert ranges.tolist() == pytest.approx([3.0, 4.0])


def test_a_large_world_keeps_the_number_of_cells_bounded():
    world = polyline((0.0, 0.0), (40_000.0, 0.0), (40_000.0, 30_000.0))
    grid = grid_of(world)
    assert grid.columns * grid.rows < 4_100_000
    assert cast(grid, (39_990.0, 10.0), [0.0])[0] == pytest.approx(10.0)
