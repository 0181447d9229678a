"""Maps and measures shared by the tests of exports."""

import io
import itertools

import numpy as np
import shapely

from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.sampling import sample_level
from tests.maps import arc_points, line_points, make_level


def wavy_document(degree=3, levels=(0.1,)):
    """Bends, a straight, holes of weight 0 and supports that end between knots, far from origin."""
    made = []
    for step in levels:
        wave = line_points((0, 0), (3, 1), step)
        wave = wave + np.column_stack((np.zeros(len(wave)), 0.3 * np.sin(4 * wave[:, 0])))
        turn = arc_points((2.0, -1.0), 0.4, 0.0, 5.0, step)
        straight = line_points((-1, -1), (-1, 2), step)
        curves = [points + np.array([-12.0, 34.0]) for points in (wave, turn, straight)]
        weights = np.full(sum(map(len, curves)), 20, np.uint8)
        weights[len(wave) // 2] = 0
        weights[-1] = 50
        made.append(make_level(curves, step, degree, weights, first_indices=[5, -7, 0], trim=0.37))
    path = np.array([[-13.0, 33.5, 0.1], [-12.0, 33.6, 0.2]], np.float32)
    meta = {"frame": "map", "software": "bsmap 0"}
    return MapDocument(degree=degree, max_weight=50, levels=tuple(made), meta=meta, path=path)


def written(writer, *arguments, **options):
    stream = io.BytesIO()
    writer(stream, *arguments, **options)
    return stream.getvalue()


def densely(line, step_m=0.001):
    """Points every millimetre along a polyline, its ends among them."""
    line = np.asarray(line, float)
    out = [line[:1]]
    for a, b in itertools.pairwise(line):
        count = max(int(np.ceil(np.hypot(*(b - a)) / step_m)), 1)
        out.append(a + np.arange(1, count + 1)[:, None] / count * (b - a))
    return np.concatenate(out)


def distances(points, lines):
    """Distance of each point to the nearest of the polylines."""
    target = shapely.MultiLineString([np.asarray(line) for line in lines])
    shapely.prepare(target)
    return shapely.distance(shapely.points(points), target)


def drawn_lines(level, step_m=0.001):
    """The drawn pieces of a level, sampled so finely that chords do not matter."""
    samples = sample_level(level, step_m)
    return np.split(samples.points, np.flatnonzero(np.diff(samples.piece)) + 1)


def assert_same_lines(lines, level, tolerance_m=0.001):
    """Both ways: the lines lie on the level's drawn curves, and the curves on the lines."""
    truth = drawn_lines(level)
    rounding = 2e-5
    found = np.concatenate([densely(line) for line in lines])
    assert distances(found, truth).max() < tolerance_m + rounding
    assert distances(np.concatenate(truth), lines).max() < tolerance_m + rounding
