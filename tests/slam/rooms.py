"""A room whose walls and pillar are known exactly, as a map and as scans from any pose."""

import numpy as np

from bsmap_cli.geometry.se2 import SE2
from tests.mapping.walls import arc, as_clusters, insert, line, new_map

WALLS = (((0.4, 0), (5.6, 0)), ((6, 0.4), (6, 3.6)), ((5.6, 4), (0.4, 4)), ((0, 3.6), (0, 0.4)))
PILLAR, RADIUS = np.array([4.0, 2.5]), 0.5
CENTRE = SE2(3.0, 2.0, 0.0)
LOOSE = np.diag([1e-6, 1e-6, 1e-6])


def room_parts(spacing=0.02):
    """Walls and pillar as an observer inside sees them: free side on the left."""
    parts = [line(a, b, spacing) for a, b in WALLS]
    return [*parts, arc(PILLAR, RADIUS, 2.0 * np.pi, 0.2, spacing)]


def corridor_parts(spacing=0.02, length=8.0, width=2.0):
    """Two walls along x, seen from between them."""
    half = 0.5 * length
    return [
        line((-half, 0), (half, 0), spacing),
        line((half, width), (-half, width), spacing),
    ]


def signed_distance(points):
    """(m,) distance to the nearest surface of the room, positive on its free side."""
    x, y = points.T
    walls = np.stack((y, 6.0 - x, 4.0 - y, x, np.hypot(*(points - PILLAR).T) - RADIUS))
    nearest = np.argmin(np.abs(walls), axis=0)
    return walls[nearest, np.arange(len(points))]


def map_of(parts, step=0.1, times=2):
    """A map of the parts, in their own frame."""
    curve_map = new_map(step)
    for _ in range(times):
        insert(curve_map, *parts)
    return curve_map


def seen_from(pose, parts, step=0.1, sigma_m=0.0):
    """The parts as clusters in the frame of an observer at `pose`."""
    inverse = pose.inverse()
    return as_clusters(
        *[inverse.transform(part) for part in parts], knot_step_m=step, sigma_m=sigma_m
    )
