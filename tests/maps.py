"""Maps made by hand for tests: lines and circles whose curves are known exactly."""

from __future__ import annotations

import itertools

import numpy as np

from bsmap_cli.mapping.map_document import MapDocument, MapLevel


def line_points(start, end, knot_step_m):
    """Control points of a straight curve of unit speed, as many as its length has knot steps."""
    start, end = np.asarray(start, float), np.asarray(end, float)
    length = np.hypot(*(end - start))
    count = round(length / knot_step_m) + 1
    return start + np.arange(count)[:, None] * knot_step_m * (end - start) / length


def arc_points(centre, radius, begin, end, knot_step_m):
    """Control points on a circular arc; the cubic runs about Delta^2 / 6R inside of it."""
    count = round(abs(end - begin) * radius / knot_step_m) + 1
    angle = np.linspace(begin, end, count)
    return np.asarray(centre) + radius * np.column_stack((np.cos(angle), np.sin(angle)))


def make_level(curves, knot_step_m=0.1, degree=3, weights=None, first_indices=None, trim=0.0):
    """A level of the curves given by their control points, drawn over their whole domain.

    trim : cut off both ends of each curve's support [knot steps].
    """
    counts = np.array([len(points) for points in curves], np.int64)
    total = int(counts.sum())
    return MapLevel(
        degree=degree,
        knot_step_m=knot_step_m,
        curve_ids=np.arange(len(curves), dtype=np.uint32) + 1,
        tau_start_m=np.full(len(curves), (degree + trim) * knot_step_m, np.float32),
        tau_end_m=((counts - trim) * knot_step_m).astype(np.float32),
        flags=np.zeros(len(curves), np.uint16),
        observations=np.full(len(curves), 7, np.uint16),
        first_indices=np.asarray(
            np.zeros(len(curves)) if first_indices is None else first_indices, np.int32
        ),
        point_counts=counts,
        control_points=np.concatenate([np.zeros((0, 2)), *curves]).astype(np.float32),
        weights=np.full(total, 5, np.uint8) if weights is None else np.asarray(weights, np.uint8),
    )


def room_document(knot_step_m=0.1, with_path=True):
    """A room of 6 x 4 m, seen from inside (walls counter-clockwise), with a round pillar in it.

    The pillar is seen from outside, so its curve runs clockwise.
    """
    corners = [(0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0), (0.0, 0.0)]
    walls = [line_points(a, b, knot_step_m) for a, b in itertools.pairwise(corners)]
    pillar = arc_points((4.0, 2.0), 0.5, 2 * np.pi, 0.0, knot_step_m)
    level = make_level([*walls, pillar], knot_step_m)
    path = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.5], [2.5, 3.0, 1.0]], np.float32)
    return MapDocument(
        degree=3,
        max_weight=50,
        levels=(level,),
        meta={"frame": "map", "software": "bsmap 0"},
        path=path if with_path else np.zeros((0, 3), np.float32),
    )
