"""Scenes in one room or along one wall: what the paper's simulations show."""

from __future__ import annotations

import math

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.motion import MotionLimits, Route
from bsmap_cli.sensor.simulator.scenes.scene import Scene
from bsmap_cli.sensor.simulator.scenes.walls import Niche
from bsmap_cli.sensor.simulator.scenes.walls import wall as straight_wall
from bsmap_cli.sensor.simulator.world import (
    Shapes,
    World,
    arc,
    box,
    circle,
    gather,
    polyline,
    regular_polygon,
)


def wall() -> Scene:
    """12 m along a wall with niches, a bay and round pilasters."""
    right_hand = gather(
        (
            straight_wall((-4.0, 0.0), (4.6, 0.0), Niche(5.6, 1.2, 0.3)),
            arc(5.0, 0.0, 0.4, 0.0, 180.0),
            polyline((5.4, 0.0), (7.0, 0.0), (7.5, 0.3), (8.7, 0.3), (9.2, 0.0)),
            straight_wall((9.2, 0.0), (14.0, 0.0), Niche(1.9, 1.1, 0.6)),
            arc(14.0, 1.5, 1.5, 270.0, 90.0),
            polyline((15.5, 1.5), (15.5, 3.0)),
        )
    )
    left_hand = gather(
        (circle(2.5, 4.2, 0.25), circle(9.6, 4.4, 0.3), box(6.0, 4.6, 1.4, 0.7, 15.0))
    )
    route = Route(SE2(0.0, 1.3, 0.0), MotionLimits(speed_m_s=0.5, bend_radius_m=2.0))
    route.drive((3.5, 1.42), (8.0, 1.2), (12.0, 1.3))
    return Scene(World(right_hand + left_hand), route.motion())


def _furnished_room() -> Shapes:
    """6 m by 5 m with a rounded and a cut corner, lower left corner of the box at the origin."""
    outline = gather(
        (
            straight_wall((0.0, 0.0), (5.0, 0.0), Niche(2.0)),
            arc(5.0, 1.0, 1.0, 270.0, 90.0),
            polyline((6.0, 1.0), (6.0, 5.0), (1.2, 5.0), (0.0, 3.8), (0.0, 0.0)),
        )
    )
    return gather(
        (outline, box(4.6, 4.1, 1.2, 0.6, 10.0), circle(1.0, 1.1, 0.2), circle(4.7, 1.7, 0.3))
    )


def spin() -> Scene:
    """360 degrees on the spot in a room with furniture."""
    route = Route(SE2(2.6, 2.4, 0.3), MotionLimits(turn_rate_rad_s=0.5))
    return Scene(World(_furnished_room()), route.turn(360.0).motion())


def _star(x: float, y: float, outer_m: float, inner_m: float) -> Shapes:
    """Five points."""
    angles = [math.pi / 2 + math.pi / 5 * index for index in range(10)]
    radii = [outer_m if index % 2 == 0 else inner_m for index in range(10)]
    corners = [
        (x + radius * math.cos(angle), y + radius * math.sin(angle))
        for angle, radius in zip(angles, radii, strict=True)
    ]
    return polyline(*corners, closed=True)


def geometric_shapes() -> Shapes:
    """A room of 10 m by 8 m with a shape of every kind in it."""
    capsule = gather(
        (
            polyline((2.0, 6.7), (3.0, 6.7)),
            polyline((3.0, 6.1), (2.0, 6.1)),
            arc(3.0, 6.4, 0.3, -90.0, 180.0),
            arc(2.0, 6.4, 0.3, 90.0, 180.0),
        )
    )
    half_disc = gather((arc(9.0, 4.2, 0.5, 90.0, 180.0), polyline((9.0, 3.7), (9.0, 4.7))))
    wave = gather((arc(4.6, 1.2, 0.5, 0.0, 180.0), arc(5.6, 1.2, 0.5, 180.0, 180.0)))
    corner = ((1.0, 3.4), (1.7, 3.4), (1.7, 3.7), (1.3, 3.7), (1.3, 4.5), (1.0, 4.5))
    return gather(
        (
            polyline((0.0, 0.0), (10.0, 0.0), (10.0, 8.0), (0.0, 8.0), closed=True),
            circle(5.0, 4.0, 0.6),
            box(1.7, 1.5, 0.8, 0.8, 30.0),
            regular_polygon(8.2, 1.6, 0.6, 3, 100.0),
            regular_polygon(8.0, 6.5, 0.55, 6, 10.0),
            _star(5.4, 6.6, 0.6, 0.27),
            capsule,
            half_disc,
            wave,
            polyline(*corner, closed=True),
        )
    )


def shapes() -> Scene:
    """Different geometric shapes in one room, driven round once."""
    route = Route(SE2(3.0, 2.6, 0.0), MotionLimits(speed_m_s=0.5, bend_radius_m=0.7))
    route.drive((7.0, 2.6), (7.0, 5.3), (2.8, 5.3), (2.8, 2.6), (5.5, 2.6))
    return Scene(World(geometric_shapes()), route.motion())
