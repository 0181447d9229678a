"""A campus: two kilometres between buildings, trees, fences and parked cars."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.sensor.simulator.motion import Motion, MotionLimits, Route
from bsmap_cli.sensor.simulator.scenes.scene import Scene
from bsmap_cli.sensor.simulator.scenes.walls import Niche, wall
from bsmap_cli.sensor.simulator.world import Shapes, World, box, circle, gather, polyline

CLEARANCE_M = 2.0
_WAYPOINTS = (
    (450.0, 20.0),
    (610.0, 150.0),
    (590.0, 350.0),
    (390.0, 440.0),
    (290.0, 300.0),
    (80.0, 380.0),
    (-90.0, 190.0),
    (0.0, 0.0),
    (80.0, 4.0),
)


def _building(random: np.random.Generator) -> Shapes:
    """A block whose near front is the x axis, free side below, niches all round."""
    long_m, deep_m = random.uniform(14.0, 38.0), random.uniform(9.0, 18.0)
    corners = ((long_m, 0.0), (0.0, 0.0), (0.0, deep_m), (long_m, deep_m), (long_m, 0.0))
    parts = []
    for start, end in pairwise(corners):
        bay_m = float(random.uniform(3.0, 5.5))
        count = int(math.dist(start, end) / bay_m)
        features = []
        for index in range(count):
            depth_m = float(random.choice((0.12, 0.3, -0.3)))
            features.append(Niche((index + 0.5) * bay_m, float(random.uniform(0.9, 2.2)), depth_m))
        parts.append(wall(start, end, *features))
    return gather(parts).at(SE2(-long_m / 2, 0.0, 0.0))


def _roadside(random: np.random.Generator) -> tuple[Shapes, float]:
    """Something to put beside the road, and how far from its middle [m]."""
    kind = random.choice(5, p=(0.35, 0.3, 0.1, 0.15, 0.1))
    if kind == 0:
        return _building(random), float(random.uniform(6.0, 13.0))
    if kind == 1:
        trees = gather(
            circle(x, float(random.uniform(0.0, 1.5)), float(random.uniform(0.1, 0.35)))
            for x in np.arange(0.0, float(random.uniform(3.0, 30.0)), 6.5)
        )
        return trees, float(random.uniform(3.5, 6.0))
    if kind == 2:
        fence_m = float(random.uniform(5.0, 25.0))
        bends = ((-fence_m / 2, 0.4), (0.0, 0.0), (fence_m / 2, float(random.uniform(0.0, 2.0))))
        return polyline(*bends), float(random.uniform(3.5, 8.0))
    if kind == 3:
        count = int(random.integers(1, 5))
        slots = [(5.6 * index, float(random.uniform(0.9, 1.2))) for index in range(count)]
        cars = [box(x, y, 4.4, 1.8, float(random.uniform(-3, 3))) for x, y in slots]
        return gather(cars), float(random.uniform(2.8, 4.0))
    post = circle(0.0, 0.0, float(random.uniform(0.06, 0.12)))
    return post, float(random.uniform(2.5, 4.0))


def _keeps_clear(shapes: Shapes, road: Points) -> bool:
    """Whether nothing of it comes closer than the clearance to a sample of the road."""
    starts, along = shapes.segments[:, :2], shapes.segments[:, 2:] - shapes.segments[:, :2]
    to_road = road[:, None] - starts
    shares = np.clip((to_road * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    gaps = np.linalg.norm(to_road - shares[..., None] * along, axis=2)
    to_arcs = np.linalg.norm(road[:, None] - shapes.arcs[:, :2], axis=2) - shapes.arcs[:, 2]
    return bool(min(gaps.min(initial=np.inf), to_arcs.min(initial=np.inf)) > CLEARANCE_M)


def _round(laps: int) -> Motion:
    limits = MotionLimits(speed_m_s=1.0, bend_radius_m=6.0, turn_rate_rad_s=0.5)
    waypoints = _WAYPOINTS[:-1] * laps + _WAYPOINTS[-1:]
    return Route(SE2(0.0, 0.0, math.atan2(20.0, 450.0)), limits).drive(*waypoints).motion()


def campus(laps: int = 1) -> Scene:
    """2 km round a campus, so many times, with the last 80 m on the first ones again."""
    motion = _round(1)
    road = motion.poses(np.arange(0.0, motion.duration_s, 1.0))
    random = np.random.default_rng(2016)
    parts = []
    for side in (1.0, -1.0):
        at_s = 0.0
        while at_s < motion.duration_s - 80.0:
            x, y, heading = motion.poses(np.array([at_s]))[0]
            shapes, offset_m = _roadside(random)
            facing = 0.0 if side > 0 else math.pi
            place = SE2(float(x), float(y), float(heading)) @ SE2(0.0, side * offset_m, facing)
            place = place @ SE2(0.0, 0.0, float(random.uniform(-0.1, 0.1)))
            shapes = shapes.at(place)
            near = road[np.hypot(road[:, 0] - x, road[:, 1] - y) < 120.0, :2]
            if _keeps_clear(shapes, near):
                parts.append(shapes)
            at_s += float(random.uniform(5.0, 22.0))
    return Scene(World(gather(parts)), _round(laps))
