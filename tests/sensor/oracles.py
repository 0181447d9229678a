"""Slow and obvious re-makings of what the simulator computes."""

import math

import numpy as np

CLOSE = 1e-7


def range_to(shapes, origin, angle):
    """The nearest surface along one ray, and whether the ray grazes an end or a flank."""
    ahead = np.array([math.cos(angle), math.sin(angle)])
    found = [hit_segment(row, origin, ahead) for row in shapes.segments]
    found += [hit_arc(row, origin, ahead) for row in shapes.arcs]
    nearest = min((distance for distance, _ in found), default=math.inf)
    return nearest, any(doubtful for _, doubtful in found)


def hit_segment(row, origin, ahead):
    along = row[2:] - row[:2]
    matrix = np.array([[ahead[0], -along[0]], [ahead[1], -along[1]]])
    if abs(np.linalg.det(matrix)) < 1e-12:
        return math.inf, True
    distance, share = np.linalg.solve(matrix, row[:2] - origin)
    doubtful = min(abs(share), abs(share - 1)) < CLOSE or abs(distance) < CLOSE
    return (distance if distance > 0 and 0 <= share <= 1 else math.inf), doubtful


def hit_arc(row, origin, ahead):
    x, y, radius, start, sweep = row
    offset = origin - (x, y)
    roots = np.roots([1.0, 2.0 * ahead @ offset, offset @ offset - radius**2])
    doubtful = abs(roots[0].real - roots[1].real) < 1e-3
    best = math.inf
    if abs(roots[0].imag) > 0:
        return best, doubtful
    for distance in sorted(roots.real):
        point = offset + distance * ahead
        turned = (math.atan2(point[1], point[0]) - start) % math.tau
        near_end = min(turned, abs(turned - sweep), math.tau - turned) < CLOSE
        doubtful |= abs(distance) < CLOSE or (near_end and sweep < math.tau)
        if distance > 0 and turned <= sweep:
            best = min(best, distance)
    return best, doubtful


def distances_to(polylines, points):
    """(m,) distance from each point to the nearest of the polylines."""
    starts = np.concatenate([line[:-1] for line in polylines])
    along = np.concatenate([np.diff(line, axis=0) for line in polylines])
    squares = (along**2).sum(axis=1)
    best = np.empty(len(points))
    for index, point in enumerate(points):
        share = np.clip(((point - starts) * along).sum(axis=1) / squares, 0.0, 1.0)
        foot = starts + share[:, None] * along
        best[index] = np.hypot(*(foot - point).T).min()
    return best


def end_points(scan):
    """(m, 2) end points of the finite ranges, laser frame."""
    ranges = scan.ranges_m.astype(np.float64)
    angles = scan.angle_min_rad + np.arange(len(ranges)) * scan.angle_increment_rad
    points = np.stack((ranges * np.cos(angles), ranges * np.sin(angles)), axis=-1)
    return points[np.isfinite(ranges)]
