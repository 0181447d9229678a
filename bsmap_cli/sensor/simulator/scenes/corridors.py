"""Scenes of corridors: where a lidar sees little along the axis, or the same thing twice."""

from __future__ import annotations

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.motion import MotionLimits, Route
from bsmap_cli.sensor.simulator.scenes.scene import Scene
from bsmap_cli.sensor.simulator.scenes.walls import Doorway, Niche, wall
from bsmap_cli.sensor.simulator.world import Shapes, World, box, circle, gather, polyline


def _ring_walls() -> Shapes:
    """Corridors 2 m wide round a block, 30 m by 20 m outside; the origin is their lower left."""
    outside = gather(
        (
            wall((0, 0), (30, 0), Niche(3.1), Niche(7.4), Doorway(12.3), Niche(18.2), Niche(24.9)),
            wall((30, 0), (30, 20), Niche(4.6), Niche(6.4), Niche(13.1, 2.2, 0.4)),
            wall((30, 20), (0, 20), Niche(5.2), Niche(11.0), Niche(16.6, 1.6, 0.3), Doorway(23.5)),
            wall((0, 20), (0, 0), Niche(3.3), Niche(9.7, 0.4, -0.2), Niche(15.8)),
        )
    )
    inside = gather(
        (
            wall((28, 2), (2, 2), Niche(4.0), Niche(9.3, 0.4, -0.25), Niche(15.5), Niche(21.7)),
            wall((2, 2), (2, 18), Niche(3.7), Niche(6.0), Niche(12.4, 1.4, 0.5)),
            wall((2, 18), (28, 18), Niche(6.1), Niche(12.2, 0.4, -0.25), Niche(17.4), Niche(20.0)),
            wall((28, 18), (28, 2), Niche(5.5), Niche(11.2, 0.4, -0.2)),
        )
    )
    rooms = gather(
        (
            polyline(
                (11.8, -0.15),
                (10.5, -0.15),
                (10.5, -3.5),
                (14.5, -3.5),
                (14.5, -0.15),
                (12.8, -0.15),
            ),
            polyline(
                (7.0, 20.15), (8.5, 20.15), (8.5, 23.0), (5.0, 23.0), (5.0, 20.15), (6.0, 20.15)
            ),
        )
    )
    return gather((outside, inside, rooms))


def loop() -> Scene:
    """A ring of corridors with doors and pillars, 30 m by 20 m, twice round."""
    pillars = gather(
        circle(x, y, radius)
        for x, y, radius in (
            (9.5, 0.25, 0.18),
            (21.0, 0.25, 0.18),
            (29.7, 10.0, 0.22),
            (14.0, 19.75, 0.18),
            (0.28, 7.0, 0.2),
            (2.0, 2.0, 0.3),
            (28.0, 18.0, 0.3),
        )
    )
    boxes = gather((box(26.6, 19.6, 0.8, 0.5, 4.0), box(0.35, 12.4, 0.45, 0.9, -3.0)))
    limits = MotionLimits(speed_m_s=0.7, bend_radius_m=0.9)
    ring = ((29.0, 1.0), (29.0, 19.0), (1.0, 19.0), (1.0, 1.0))
    route = Route(SE2(5.0, 1.0, 0.0), limits).drive(*ring, *ring, (7.0, 1.0))
    return Scene(World(gather((_ring_walls(), pillars, boxes))), route.motion())


def corridor() -> Scene:
    """Two bare parallel walls that end beyond the reach of any lidar here."""
    walls = gather((wall((-120, 0), (120, 0)), wall((120, 2.4), (-120, 2.4))))
    route = Route(SE2(-10.0, 1.1, 0.0), MotionLimits(speed_m_s=0.5, bend_radius_m=2.0))
    route.drive((-3.0, 1.3), (4.0, 1.1), (10.0, 1.2))
    return Scene(World(walls), route.motion())


def _twin(x: float) -> Shapes:
    """A room of 6 m by 5 m north of the corridor, its lower left corner at (x, 0)."""
    outline = gather(
        (
            wall((0, 0.15), (6, 0.15), Doorway(3.0, 1.1, 0.0)),
            polyline((6, 0.15), (6, 5), (0, 5), (0, 0.15)),
        )
    )
    furniture = gather((box(1.2, 4.2, 1.6, 0.8), box(5.1, 3.0, 0.7, 1.8), circle(1.0, 1.4, 0.25)))
    return (outline + furniture).at(SE2(x, 0.0, 0.0))


def twins() -> Scene:
    """Two identical rooms on one corridor: into one, into the other, and back to the first."""
    passage = gather(
        (
            wall((22, 0), (-2, 0), Doorway(5.0, 1.1), Doorway(19.0, 1.1)),
            wall((-2, -2), (22, -2), Niche(5.0), Niche(12.0, 0.5, -0.25), Niche(19.0)),
            polyline((-2, 0), (-2, -2)),
            polyline((22, -2), (22, 0)),
        )
    )
    tour = ((3.0, 2.2), (3.0, 3.6))
    limits = MotionLimits(speed_m_s=0.5, bend_radius_m=0.6)
    route = Route(SE2(3.0, 3.6, 0.5), limits).turn(300.0)
    route.drive((3.0, 2.2), (3.0, -1.0), (17.0, -1.0), (17.0, 3.6)).turn(300.0)
    route.drive((17.0, -1.0), (3.0, -1.0), *tour).turn(180.0)
    return Scene(World(gather((passage, _twin(0.0), _twin(14.0)))), route.motion())
