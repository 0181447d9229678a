"""Scenes in larger buildings: a long corridor, and an office whose rooms are entered."""

from __future__ import annotations

import numpy as np

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.motion import MotionLimits, Route
from bsmap_cli.sensor.simulator.scenes.scene import Scene
from bsmap_cli.sensor.simulator.scenes.walls import Doorway, Niche, wall
from bsmap_cli.sensor.simulator.world import Shapes, World, box, circle, gather, polyline

HALLWAY_M = 110.0
HALLWAY_WIDTH_M = 2.4


def _lobby(x: float) -> Shapes:
    """8 m by 7 m, open to the right between y = 0 and the corridor's width; its right edge at x."""
    outline = polyline((0, 0), (0, -2.5), (-8, -2.5), (-8, 4.5), (0, 4.5), (0, HALLWAY_WIDTH_M))
    furniture = gather((box(-6.8, 3.6, 1.8, 0.9, 8.0), circle(-2.5, -1.4, 0.3)))
    return (outline + furniture).at(SE2(x, 0.0, 0.0))


def hallway() -> Scene:
    """From a lobby down a corridor of 110 m with a door every few metres, and back."""
    doors = (6.0, 9.6, 13.2, 20.4, 27.6, 31.2, 42.0, 49.2, 60.0, 67.2, 74.4, 85.2, 88.8, 103.2)
    length_m, width_m = HALLWAY_M, HALLWAY_WIDTH_M
    north_doors = (Niche(length_m - at_m) for at_m in reversed(doors[::2]))
    walls = gather(
        (
            wall((0, 0), (length_m, 0), *(Niche(at_m) for at_m in doors)),
            wall((length_m, width_m), (0, width_m), *north_doors),
        )
    )
    far_lobby = _lobby(0.0).at(SE2(length_m, width_m, np.pi))
    cupboards = gather((box(36.0, 0.2, 1.2, 0.4), box(80.0, 2.2, 0.9, 0.4), box(115.0, -1.6, 1, 1)))
    route = Route(SE2(-5.5, -0.5, 0.0), MotionLimits(speed_m_s=0.8, bend_radius_m=1.0))
    route.drive((-3.0, -0.5), (-1.0, 1.1), (55.0, 1.3), (111.0, 1.1), (114.5, 2.6))
    route.drive((111.0, 1.3), (55.0, 1.1), (-1.0, 1.3), (-3.5, 2.4))
    return Scene(World(gather((walls, _lobby(0.0), far_lobby, cupboards))), route.motion())


def _office_room(width_m: float, random: np.random.Generator) -> Shapes:
    """A room with its lower left corner at the origin and its door in the wall below, 5 m deep.

    Desks and shelves stand along the side walls, chairs on four thin legs before them; a lane from
    the door in the middle stays free.
    """
    left, right = 0.05, width_m - 0.05  # walls between rooms are 0.1 m thick
    outline = polyline((right, 0.1), (right, 5.0), (left, 5.0), (left, 0.1))
    door = Doorway(width_m / 2 - left, 1.0, 0.0)
    parts = [wall((left, 0.1), (right, 0.1), door), outline]
    for side in (-1.0, 1.0):
        along = 0.9
        while along < 4.0:
            long_m = min(float(random.uniform(0.6, 1.6)), 4.95 - along)
            deep_m = float(random.uniform(0.3, 0.7))
            x = width_m / 2 + side * (width_m / 2 - deep_m / 2 - 0.07)
            if random.random() < 0.75:
                parts.append(box(x, along + long_m / 2, deep_m, long_m))
            if random.random() < 0.4:
                parts.append(_chair(x - side * (deep_m / 2 + 0.3), along + long_m / 2, random))
            along += long_m + float(random.uniform(0.1, 0.8))
    return gather(parts)


def _chair(x: float, y: float, random: np.random.Generator) -> Shapes:
    """Four legs."""
    legs = gather(circle(dx, dy, 0.015) for dx in (-0.18, 0.18) for dy in (-0.18, 0.18))
    return legs.at(SE2(x, y, float(random.uniform(-0.5, 0.5))))


def office() -> Scene:
    """A corridor with five furnished rooms on each side; the robot looks into six of them."""
    random = np.random.default_rng(20)
    widths = (4.0, 5.2, 4.0, 6.0, 4.4)
    lefts = np.concatenate(([0.0], np.cumsum(widths)))
    middles = [float(left) + width / 2 for left, width in zip(lefts, widths, strict=False)]
    length_m = float(lefts[-1])
    north = [
        _office_room(width, random).at(SE2(float(left), 2.0, 0.0))
        for left, width in zip(lefts, widths, strict=False)
    ]
    turned = SE2(length_m, 0.0, np.pi)
    south = [
        _office_room(width, random).at(turned @ SE2(float(left), 0.0, 0.0))
        for left, width in zip(lefts, widths, strict=False)
    ]
    mirrored = [Doorway(length_m - middle, 1.0, 0.1) for middle in reversed(middles)]
    north_wall = wall((length_m, 2.0), (0.0, 2.0), *mirrored)
    south_wall = wall((length_m, 2.0), (0.0, 2.0), *mirrored).at(turned @ SE2(0.0, -2.0, 0.0))
    ends = gather((polyline((0, 2), (0, 0)), polyline((length_m, 0), (length_m, 2))))
    route = Route(SE2(0.8, 1.0, 0.0), MotionLimits(speed_m_s=0.6, bend_radius_m=0.5))
    for middle in (middles[0], middles[1], middles[3]):
        route.drive((middle, 1.0), (middle, 5.4)).turn(170.0).drive((middle, 1.0))
    for middle in (length_m - middles[0], length_m - middles[2], length_m - middles[4]):
        route.drive((middle, 1.0), (middle, -3.4)).turn(-170.0).drive((middle, 1.0))
    route.drive((2.5, 1.0))
    parts = [*north, *south, north_wall, south_wall, ends]
    return Scene(World(gather(parts)), route.motion())
