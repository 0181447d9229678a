"""What `stats` says, beside sums by hand and a naive count of what is drawn twice."""

import io
import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.evaluation.map_statistics import map_statistics, sizes_of
from bsmap_cli.evaluation.redundancy import redundancy
from bsmap_cli.geometry.near_pairs import sort_into_cells
from bsmap_cli.mapping.map_document import MapDocument, MapLevel
from bsmap_cli.mapping.map_file import read_map_with_sizes, write_map
from bsmap_cli.mapping.sampling import sample_level
from tests.maps import arc_points, line_points, make_level, room_document


def naive_redundancy(level):
    step = level.knot_step_m
    samples = sample_level(level, step / 4)
    count, covered = len(samples.tau_m), 0
    for i in range(count):
        rank = (samples.weight[i], -int(level.curve_ids[samples.curve[i]]))
        for j in range(count - 1):
            if samples.piece[j] != samples.piece[j + 1]:
                continue
            apart = abs(samples.tau_m[i] - samples.tau_m[j])
            if samples.curve[i] == samples.curve[j] and apart <= 2 * step:
                continue
            a, b, p = samples.points[j], samples.points[j + 1], samples.points[i]
            f = min(max(np.dot(p - a, b - a) / np.dot(b - a, b - a), 0.0), 1.0)
            weight = samples.weight[j] + f * (samples.weight[j + 1] - samples.weight[j])
            cosine = np.dot(samples.tangents[i], b - a) / math.dist(a, b)
            if (
                math.dist(p, a + f * (b - a)) <= step / 2
                and cosine >= math.cos(math.pi / 6)
                and (weight, -int(level.curve_ids[samples.curve[j]])) > rank
            ):
                covered += 1
                break
    return count / (count - covered)


@given(st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_redundancy_beside_the_naive_one(seed):
    rng = np.random.default_rng(seed)
    curves = []
    for _ in range(4):
        start = rng.uniform(-0.2, 0.2, 2)
        curves.append(line_points(start, start + rng.uniform(0.4, 1.0, 2), 0.1))
    curves.append(arc_points((0.5, 0.5), 0.2, 0.0, 4 * np.pi, 0.1))
    weights = rng.integers(1, 4, sum(map(len, curves)))
    level = make_level(curves, weights=weights)
    assert redundancy(level) == pytest.approx(naive_redundancy(level))


def test_redundancy_in_tiles_is_that_of_the_whole(monkeypatch):
    rng = np.random.default_rng(3)
    curves = []
    for _ in range(60):
        start = rng.uniform(-3.0, 3.0, 2)
        curves.append(line_points(start, start + rng.uniform(0.4, 4.0, 2), 0.1))
    level = make_level(curves, weights=rng.integers(1, 4, sum(map(len, curves))))
    whole = redundancy(level)
    assert whole > 1.01
    monkeypatch.setattr("bsmap_cli.evaluation.redundancy.PORTION", 100)
    assert redundancy(level) == pytest.approx(whole, abs=1e-12)


def test_portions_of_a_level_are_its_curves_in_order():
    rng = np.random.default_rng(5)
    curves = [line_points((0, k), (rng.uniform(0.4, 4.0), k), 0.1) for k in range(20)]
    level = make_level(curves, weights=rng.integers(1, 4, sum(map(len, curves))))
    portions = list(level.portions(50))
    assert len(portions) > 3
    for first, part in portions:
        kept = (np.arange(len(level)) >= first) & (np.arange(len(level)) < first + len(part))
        for name in MapLevel.__dataclass_fields__:
            np.testing.assert_array_equal(getattr(part, name), getattr(level.only(kept), name))
    joined = np.concatenate([part.control_points for _, part in portions])
    np.testing.assert_array_equal(joined, level.control_points)
    odd = level.only(np.arange(len(level)) % 2 == 1)
    np.testing.assert_array_equal(odd.control_points, np.concatenate(curves[1::2]).astype("f4"))


LINE = line_points((0, 0), (4, 0), 0.1)


@pytest.mark.parametrize(
    ("curves", "expected"),
    [
        ([LINE], 1.0),
        ([LINE, LINE], 2.0),
        ([LINE, LINE + np.array([0.0, 0.04])], 2.0),
        ([LINE, LINE + np.array([0.0, 0.06])], 1.0),
        ([LINE, LINE[::-1]], 1.0),  # the other side of a thin wall
        ([LINE, LINE, LINE], 3.0),
        ([LINE, line_points((2, -2), (2, 2), 0.1)], 1.0),
        ([], 1.0),
    ],
)
def test_known_redundancy(curves, expected):
    assert redundancy(make_level(curves)) == pytest.approx(expected)


def test_a_curve_that_goes_round_twice_covers_itself():
    twice = arc_points((0, 0), 1.0, 0.0, 4 * np.pi, 0.1)
    weights = np.where(np.arange(len(twice)) < len(twice) // 2, 9, 5)
    assert redundancy(make_level([twice], weights=weights)) == pytest.approx(2.0, abs=0.1)


@given(st.integers(0, 10_000), st.floats(0.01, 3.0))
@settings(deadline=None)
def test_near_pairs_miss_none(seed, reach):
    rng = np.random.default_rng(seed)
    points, others = rng.uniform(-2, 2, (20, 2)), rng.uniform(-2, 2, (30, 2))
    cells = sort_into_cells(others, reach, points)
    found = list(zip(*(rows.tolist() for rows in cells.pairs(points)), strict=True))
    assert len(found) == len(set(found))
    distance = np.hypot(*(points[:, None] - others[None]).transpose(2, 0, 1))
    assert {(int(i), int(j)) for i, j in np.argwhere(distance <= reach)} <= set(found)


def statistics(document, **options):
    stream = io.BytesIO()
    write_map(stream, document, **options)
    stream.seek(0)
    document, sizes = read_map_with_sizes(stream)
    return map_statistics(document, sizes), stream


def test_every_key_of_the_contract():
    figures, stream = statistics(room_document())
    document = json.loads(json.dumps(figures.as_json()))
    assert set(document) == {
        *("file_bytes", "payload_bytes", "path_bytes", "curves", "control_points"),
        *("bytes_per_control_point", "degree", "length_m", "bounds_m", "redundancy", "levels"),
        *("grid_5cm_bytes", "ratio_to_grid_5cm", "grid_5cm_png_bytes", "ratio_to_png"),
    }
    assert set(document["levels"][0]) == {
        *("knot_step", "curves", "control_points", "bytes", "length_m"),
    }
    assert document["file_bytes"] == len(stream.getvalue())


def test_figures_of_the_room():
    figures, _ = statistics(room_document())
    count = 61 + 41 + 61 + 41 + 32
    assert (figures.curves, figures.control_points, figures.degree) == (5, count, 3)
    assert figures.payload_bytes == 16 * 5 + 8 * 5 + 9 * count
    assert figures.path_bytes == 4 + 3 * 12
    assert figures.bytes_per_control_point == 9.0
    walls = 5.8 + 3.8 + 5.8 + 3.8
    assert figures.length_m == pytest.approx(walls + math.pi - 0.2, rel=0.01)
    np.testing.assert_allclose(figures.bounds_m, [0, 0, 6, 4], atol=1e-6)
    assert figures.redundancy == 1.0
    assert figures.grid_5cm_bytes == 140 * 100
    assert figures.ratio_to_grid_5cm == pytest.approx(14000 / figures.payload_bytes)
    assert figures.ratio_to_png == pytest.approx(figures.grid_5cm_png_bytes / figures.payload_bytes)
    assert 0 < figures.grid_5cm_png_bytes < 14000 / 8


def test_top_level_figures_are_the_finest_level_s():
    coarse = make_level([line_points((0, 0), (8, 0), 0.4)], 0.4)
    fine = make_level([line_points((0, 1), (4, 1), 0.1)], 0.1)
    figures, _ = statistics(MapDocument(degree=3, max_weight=50, levels=(coarse, fine)))
    assert [level.knot_step for level in figures.levels] == [0.4, 0.1]
    assert figures.curves == figures.levels[1].curves == 1
    assert figures.length_m == figures.levels[1].length_m == pytest.approx(3.8, abs=1e-5)
    assert figures.levels[0].length_m == pytest.approx(7.2, abs=1e-5)
    assert figures.path_bytes == 0


def test_compressed_bytes_are_those_of_the_block():
    raw, _ = statistics(room_document())
    small, _ = statistics(room_document(), compress=True)
    assert small.payload_bytes < raw.payload_bytes
    assert small.bytes_per_control_point == small.payload_bytes / small.control_points


def test_sizes_without_a_file():
    document = room_document()
    assert map_statistics(document, sizes_of(document)) == statistics(document)[0]


def test_an_empty_map_has_nothing_to_divide():
    figures, _ = statistics(MapDocument(degree=3, max_weight=50, levels=(make_level([]),)))
    assert (figures.length_m, figures.redundancy, figures.bounds_m) == (0.0, 1.0, None)
    assert figures.ratio_to_grid_5cm is figures.ratio_to_png is None


def test_a_map_too_wide_for_a_grid_still_has_statistics():
    far = line_points((9e3, 9e3), (9e3, 9e3 + 1), 0.1)
    document = MapDocument(degree=3, max_weight=50, levels=(make_level([LINE, far]),))
    figures, _ = statistics(document)
    assert figures.grid_5cm_bytes > 2**34
    assert figures.grid_5cm_png_bytes is figures.ratio_to_png is None
