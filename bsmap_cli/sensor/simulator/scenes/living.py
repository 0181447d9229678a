"""Scenes that do not hold still: people walk, vans pass, a box is taken away."""

from __future__ import annotations

import math
from collections.abc import Sequence

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.motion import Motion, MotionLimits, Route
from bsmap_cli.sensor.simulator.scenes.scene import Scene
from bsmap_cli.sensor.simulator.scenes.walls import Niche, wall
from bsmap_cli.sensor.simulator.world import Guest, World, box, circle, gather, polyline

_WALK = MotionLimits(speed_m_s=1.2, acceleration_m_s2=1.0, turn_rate_rad_s=3.0)
_DRIVE_BY = MotionLimits(speed_m_s=3.0, acceleration_m_s2=1.0)


def _to_and_fro(
    start: Sequence[float], end: Sequence[float], limits: MotionLimits, wait_s: float, rounds: int
) -> Motion:
    """There and back again, with a wait at each end and one before the first start."""
    heading = math.atan2(end[1] - start[1], end[0] - start[0])
    route = Route(SE2(start[0], start[1], heading), limits)
    for _ in range(rounds):
        route.wait(wait_s).drive(end).wait(wait_s).drive(start)
    return route.motion()


def people() -> Scene:
    """Twice round a hall with pillars while six people walk through it."""
    hall = gather(
        (
            wall((0, 0), (16, 0), Niche(3.0), Niche(12.5, 1.6, 0.4)),
            wall((16, 0), (16, 10), Niche(6.5)),
            wall((16, 10), (0, 10), Niche(4.0, 1.6, 0.3), Niche(11.0)),
            wall((0, 10), (0, 0), Niche(2.8)),
        )
    )
    pillars = gather(
        circle(x, y, 0.3) for x, y in ((5.0, 3.6), (5.0, 6.4), (11.0, 3.6), (11.0, 6.4))
    )
    legs = gather((circle(0.0, 0.12, 0.07), circle(0.0, -0.12, 0.07)))
    walks = (
        ((4.0, 0.6), (4.0, 9.4), 7.5),
        ((1.0, 5.0), (15.0, 5.0), 7.0),
        ((8.5, 9.3), (8.5, 0.7), 6.5),
        ((12.5, 0.7), (9.5, 9.2), 3.0),
        ((0.7, 8.8), (15.0, 9.2), 4.5),
        ((6.2, 5.6), (9.8, 4.2), 0.75),
    )
    crowd = tuple(
        Guest(shapes=legs, motion=_to_and_fro(start, end, _WALK, wait_s, 10))
        for start, end, wait_s in walks
    )
    route = Route(SE2(3.0, 2.0, 0.0), MotionLimits(speed_m_s=0.6, bend_radius_m=0.9))
    ring = ((14.0, 2.0), (14.0, 8.0), (2.0, 8.0), (2.0, 2.0))
    return Scene(World(hall + pillars, crowd), route.drive(*ring, *ring, (5.0, 2.0)).motion())


def yard() -> Scene:
    """Along the ramps of a loading yard while vans come, pass and leave."""
    ramps = (
        Niche(8.0, 3.0, 0.8),
        Niche(16.0, 3.0, 0.8),
        Niche(24.0, 3.0, 0.8),
        Niche(33.0, 1.2, 0.3),
    )
    walls = gather(
        (
            wall((40, 24), (0, 24), *ramps),
            polyline((0, 24), (0, 9), (-3, 9), (-3, 2), (0, 2), (0, 0), (40, 0), (40, 24)),
            gather(circle(x, 12.0, 0.2) for x in (6.0, 14.0, 26.0, 34.0)),
            box(20.0, 12.0, 2.4, 1.2, 20.0),
            box(4.0, 1.6, 1.2, 1.0),
            box(31.0, 1.5, 2.2, 1.1, -5.0),
        )
    )
    van = box(0.0, 0.0, 5.2, 2.0)
    guests = (
        Guest(shapes=van, motion=_to_and_fro((9.5, 9.0), (31.0, 9.0), _DRIVE_BY, 4.0, 10)),
        Guest(shapes=van, motion=_to_and_fro((30.5, 14.2), (9.0, 14.2), _DRIVE_BY, 7.0, 10)),
        Guest(shapes=van, motion=SE2(16.0, 21.2, math.pi / 2), to_s=60.0),
        Guest(shapes=van, motion=SE2(32.0, 21.2, math.pi / 2), from_s=75.0),
    )
    route = Route(SE2(4.0, 4.5, 0.0), MotionLimits(speed_m_s=0.8, bend_radius_m=1.5))
    ring = ((37.0, 4.5), (37.0, 17.2), (3.0, 17.2), (3.0, 4.5))
    return Scene(World(walls, guests), route.drive(*ring, *ring, (8.0, 4.5)).motion())


def changes() -> Scene:
    """Four times round a room; half way a box is taken away and another one put elsewhere."""
    room = gather(
        (
            wall((0, 0), (8, 0), Niche(2.0)),
            wall((8, 0), (8, 6), Niche(3.5, 1.2, 0.3)),
            wall((8, 6), (0, 6), Niche(5.0)),
            polyline((0, 6), (0, 0)),
            circle(4.0, 3.0, 0.35),
        )
    )
    ring = ((6.3, 1.6), (6.3, 4.4), (1.7, 4.4), (1.7, 1.6))
    route = Route(SE2(2.8, 1.6, 0.0), MotionLimits(speed_m_s=0.5, bend_radius_m=0.7))
    motion = route.drive(*ring, *ring, *ring, *ring, (4.0, 1.6)).motion()
    half_s = motion.duration_s / 2
    guests = (
        Guest(shapes=box(0.0, 0.0, 1.2, 0.7), motion=SE2(5.6, 5.5, 0.1), to_s=half_s),
        Guest(shapes=box(0.0, 0.0, 0.8, 0.8), motion=SE2(0.6, 3.0, 0.3), from_s=half_s),
    )
    return Scene(World(room, guests), motion)
