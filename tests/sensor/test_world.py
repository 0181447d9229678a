import math

import numpy as np
import pytest

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.motion import Route
from bsmap_cli.sensor.simulator.raycast import ranges_to
from bsmap_cli.sensor.simulator.scenes import SCENES
from bsmap_cli.sensor.simulator.scenes.walls import Doorway, Niche, wall
from bsmap_cli.sensor.simulator.simulation import simulate
from bsmap_cli.sensor.simulator.world import Guest, World, arc, box, circle, gather, polyline

POSE = SE2(3.0, -1.0, 0.9)
MIXED = gather((box(1.0, 2.0, 0.6, 0.3, 20.0), arc(-1.0, 0.5, 0.7, 40.0, 200.0)))


def test_moved_shapes_are_seen_alike_from_the_moved_place():
    directions = np.linspace(-math.pi, math.pi, 300)
    here = ranges_to(MIXED, np.zeros(2), directions)
    there = ranges_to(MIXED.at(POSE), np.array([POSE.x, POSE.y]), directions + POSE.theta)
    assert there == pytest.approx(here, abs=1e-9)


def test_polylines_move_with_their_shapes():
    moved = MIXED.at(POSE).polylines()
    for line, expected in zip(moved, MIXED.polylines(), strict=True):
        assert line == pytest.approx(POSE.transform(expected), abs=1e-9)


def test_a_guest_is_there_for_its_time_and_where_its_motion_says():
    walk = Route(SE2(0.0, 0.0, 0.0)).drive((10.0, 0.0)).motion()
    walker = Guest(shapes=circle(0.0, 0.0, 0.2), motion=walk, from_s=2.0, to_s=8.0)
    world = World(box(0.0, 0.0, 50.0, 50.0), (walker,))
    assert [len(world.visitors(time_s)) for time_s in (1.99, 2.0, 7.99, 8.0)] == [0, 1, 1, 0]
    x = walk.poses(np.array([5.0]))[0, 0]
    assert world.visitors(5.0).arcs[0, :3] == pytest.approx([x, 0.0, 0.2])
    assert len(world.surfaces()) == 4  # what walks is no surface of the map


def test_a_wall_steps_back_at_niches_forward_at_pilasters_and_opens_at_doors():
    """Rays from the free side, which is on the left of start to end."""
    features = (Niche(2.0, 1.0, 0.3), Niche(4.0, 1.0, -0.2), Doorway(6.0, 1.0, 0.4))
    shapes = wall((1.0, 1.0), (1.0, 9.0), *features)
    looking_right = np.zeros(1)
    for along, expected in ((0.5, 1.0), (2.0, 1.3), (4.0, 0.8), (6.0, math.inf), (7.5, 1.0)):
        ranges = ranges_to(shapes, np.array([0.0, 1.0 + along]), looking_right)
        assert ranges[0] == pytest.approx(expected)


def test_points_that_repeat_make_no_segment():
    assert len(polyline((0.0, 0.0), (0.0, 0.0), (1.0, 0.0))) == 1


def test_the_box_of_changes_goes_and_the_other_comes_half_way():
    simulation = simulate("changes", lidar="lms200", rate_hz=1.0)
    gone, come = simulation.world.guests
    half_s = simulation.motion.duration_s / 2
    assert (gone.to_s, come.from_s) == (half_s, half_s)
    timed = [
        s for s in simulation.world.surfaces() if math.isfinite(s.from_s) or math.isfinite(s.to_s)
    ]
    assert sum(surface.to_s == half_s for surface in timed) == 4
    assert sum(surface.from_s == half_s for surface in timed) == 4


def test_the_twins_are_twins():
    world = SCENES["twins"].build().world
    around = np.linspace(-math.pi, math.pi, 721)
    for x, y in ((3.0, 3.6), (2.2, 1.7), (4.0, 3.0)):
        first = ranges_to(world.standing, np.array([x, y]), around, 4.0)
        second = ranges_to(world.standing, np.array([x + 14.0, y]), around, 4.0)
        assert second == pytest.approx(first, abs=1e-9)


def test_the_corridor_looks_the_same_all_along():
    """Where the walls are bare, nothing tells how far the robot has come."""
    world = SCENES["corridor"].build().world
    around = np.linspace(-math.pi, math.pi, 721)
    views = [
        ranges_to(world.standing, np.array([x, 1.1]), around, 80.0) for x in (-10.0, 0.3, 10.0)
    ]
    assert views[1] == pytest.approx(views[0], abs=1e-9)
    assert views[2] == pytest.approx(views[0], abs=1e-9)


def test_the_campus_is_two_kilometres_long():
    motion = SCENES["campus"].build().motion
    poses = motion.poses(np.arange(0.0, motion.duration_s, 0.2))
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).sum() == pytest.approx(2000.0, rel=0.03)
