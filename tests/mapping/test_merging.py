"""Merging on the lattice against a dictionary of control points, and maps that grow from scans."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.geometry.curve import Curve
from bsmap_cli.mapping.insertion import insert_clusters
from bsmap_cli.mapping.merging import LEAST_WEIGHT, extend_rows, merge_fitted, observed_share
from tests.mapping.walls import (
    MATRIX,
    SETTINGS,
    STEP,
    STILL,
    arc,
    as_clusters,
    drawn_points,
    frozen,
    insert,
    line,
    live_curves,
    new_map,
    speeds,
)

seeds = st.integers(0, 2**32)
CAP = 6.0


@st.composite
def stretches(draw, most=6):
    """(first lattice index, control points, shares): nested, touching, contained, one span long."""
    random = np.random.default_rng(draw(seeds))
    found = []
    # touching curves: gaps inside a curve are no curve, so each one meets the reach of the others
    low, high = 0, 8
    for _ in range(draw(st.integers(1, most))):
        count = draw(st.integers(4, 14))
        first = draw(st.integers(low - count, high))
        low, high = min(low, first), max(high, first + count)
        shares = random.choice([0.05, 0.5, 1.0, 1.2], count)
        found.append((first, random.uniform(-1.0, 1.0, (count, 2)), shares))
    return [(0, random.uniform(-1.0, 1.0, (8, 2)), np.ones(8)), *found]


def merge_all(pieces, cap=CAP, by_table=False):
    """One map curve out of all pieces, as the arrays hold it: first index, points, weights."""
    curve_map = new_map(rows=16)
    curve = -1
    for first, points, shares in pieces:
        curve_map.reserve(4 * (200 + len(points)))
        start, end = first + 3.0, first + float(len(points))
        curve = merge_fitted(
            curve_map.arrays, MATRIX, STEP, curve, first, points, shares, start, end, cap, by_table
        )
        assert curve == 0
    return live_curves(curve_map)[0]


def dictionary_merge(pieces, cap=CAP):
    """METHOD 1.5: every lattice index g keeps its own running mean."""
    held = {}
    for first, points, shares in pieces:
        for g, point, share in zip(range(first, first + len(points)), points, shares, strict=True):
            part = min(1.0, share)
            if g not in held:
                held[g] = (point, max(part, LEAST_WEIGHT))
                continue
            mean, weight = held[g]
            new = min(cap, weight + part)
            held[g] = (mean + part / new * (point - mean), new)
    order = sorted(held)
    return order, np.array([held[g][0] for g in order]), np.array([held[g][1] for g in order])


@given(stretches())
@settings(max_examples=150, deadline=None)
def test_oracle_10_merge_is_the_union_of_dictionaries(pieces):
    order, points, weights = dictionary_merge(pieces)
    first, merged, kept, support = merge_all(pieces)
    observed = np.flatnonzero(kept > 0.0)
    assert (first + observed).tolist() == order
    assert merged[observed] == pytest.approx(points, abs=1e-12)
    assert kept[observed] == pytest.approx(weights, abs=1e-12)
    assert support.tolist() == [
        min(first + 3.0 for first, _, _ in pieces),
        max(float(first + len(points)) for first, points, _ in pieces),
    ]


def as_curve(first, points):
    return Curve(
        degree=3,
        knot_step_m=STEP,
        first_index=first,
        control_points=points,
        weights=np.ones(len(points)),
        tau_start_m=(first + 3) * STEP,
        tau_end_m=(first + len(points)) * STEP,
    )


@given(seeds, st.integers(-4, 4), st.integers(1, 5))
@settings(max_examples=60, deadline=None)
def test_oracle_11_and_12_merge_commutes_with_evaluation_and_leaves_the_rest(seed, shift, alpha):
    random = np.random.default_rng(seed)
    held, seen = random.normal(size=(16, 2)), random.normal(size=(8, 2))
    first = 4 + shift
    pieces = [(0, held, np.ones(16))] * alpha + [(first, seen, np.ones(8))]
    _, points, _, _ = merge_all(pieces, cap=50.0)
    merged, old, new = as_curve(0, points), as_curve(0, held), as_curve(first, seen)
    fused = np.linspace(new.tau_start_m, new.tau_end_m, 40)
    expected = (alpha * old.evaluate(fused) + new.evaluate(fused)) / (alpha + 1)
    assert merged.evaluate(fused) == pytest.approx(expected, abs=1e-12)
    u = np.linspace(3.0, 16.0, 131)
    untouched = u[(u <= first) | (u >= first + 11)] * STEP
    assert merged.evaluate(untouched) == pytest.approx(old.evaluate(untouched), abs=1e-12)


@given(stretches(most=1), st.integers(2, 9))
@settings(max_examples=40, deadline=None)
def test_oracle_13_merging_a_curve_with_itself_changes_no_point(pieces, times):
    once, again = merge_all(pieces[:1]), merge_all(pieces[:1] * times)
    assert again[1] == pytest.approx(once[1], abs=1e-14)
    assert again[2].max() == min(CAP, times)


@given(stretches(), seeds)
@settings(max_examples=60, deadline=None)
def test_oracle_14_order_does_not_matter_below_saturation(pieces, seed):
    full = [(first, points, np.ones(len(points))) for first, points, _ in pieces]
    order = np.random.default_rng(seed).permutation(len(full))
    here = merge_all(full, cap=50.0)
    there = merge_all([full[k] for k in order], cap=50.0)
    g = {first + k: point for first, points, *_ in [here] for k, point in enumerate(points)}
    total, count = {}, {}
    for first, points, _ in full:
        for k, point in enumerate(points):
            total[first + k] = total.get(first + k, 0.0) + point
            count[first + k] = count.get(first + k, 0) + 1
    for k, point in enumerate(there[1]):
        if there[2][k] > 0.0:
            index = there[0] + k
            assert point == pytest.approx(g[index], abs=1e-12)
            assert point == pytest.approx(total[index] / count[index], abs=1e-12)
            assert there[2][k] == count[index]


def test_a_saturated_weight_makes_the_mean_fade():
    curve_pieces = [(0, np.zeros((6, 2)), np.ones(6))] * 10 + [(0, np.ones((6, 2)), np.ones(6))]
    _, points, weights, _ = merge_all(curve_pieces, cap=4.0)
    assert points == pytest.approx(np.full((6, 2), 0.25))
    assert weights.tolist() == [4.0] * 6


@given(stretches())
@settings(max_examples=60, deadline=None)
def test_oracle_28_no_pair_of_curves_is_refused(pieces):
    for by_table in (False, True):
        _, points, weights, _ = merge_all(pieces, by_table=by_table)
        assert np.isfinite(points[weights > 0.0]).all()
        assert weights.max() <= CAP


@given(seeds, st.lists(st.tuples(st.integers(0, 9), st.integers(0, 9)), min_size=1, max_size=9))
@settings(max_examples=60, deadline=None)
def test_growth_at_both_ends_keeps_control_points_and_neighbours(seed, growths):
    """Rows move when a curve outgrows its room; nothing else may notice."""
    curve_map, random = new_map(rows=4000), np.random.default_rng(seed)
    pieces = [(0, random.normal(size=(6, 2)), np.ones(6)) for _ in range(3)]
    curve_map.reserve(3000)
    for first, points, shares in pieces:
        merge_fitted(
            curve_map.arrays, MATRIX, STEP, -1, first, points, shares, 3.0, 6.0, CAP, False
        )
    low, high = 0, 6
    for before, behind in growths:
        low, high = low - before, high + behind
        extend_rows(curve_map.arrays, 1, low, high)
    others = live_curves(curve_map)
    for curve in (0, 2):
        assert np.array_equal(others[curve][1], pieces[curve][1])
    first, points, weights, _ = others[1]
    assert (first, len(points)) == (low, high - low)
    assert np.array_equal(points[-low : 6 - low], pieces[1][1])
    assert weights.tolist() == [0.0] * -low + [1.0] * 6 + [0.0] * (high - 6)
    owned = np.flatnonzero(curve_map.arrays.owner == 1)
    offset = curve_map.arrays.offset[1]
    assert set(range(offset, offset + high - low)) <= set(owned)


def test_observed_share_is_one_inside_whatever_the_density():
    """METHOD 1.5: interior 1.00; the three control points at an end get less and less."""
    for spacing in (0.01, 0.05, 0.25):
        u = np.arange(0.0, 10.0 + 1e-9, spacing)
        weights = np.full(len(u), spacing)
        weights[[0, -1]] *= 0.5
        omega = np.empty(13)
        observed_share(u, weights, MATRIX, 0, omega)
        assert omega[3:-3] == pytest.approx(np.ones(7), abs=0.005)
        assert np.all(np.diff(omega[:4]) > 0.0)
        assert omega[0] == pytest.approx(1 / 24, abs=0.02)


@pytest.mark.parametrize("radius", [1.0, 3.0])
def test_merging_a_curves_own_samples_leaves_what_is_drawn(radius):
    curve_map = new_map()
    insert(curve_map, arc((0, 0), radius, 3.0, 0.2))
    before = frozen(curve_map)[0]
    for _ in range(10):
        curve = frozen(curve_map)[0]
        tau = np.append(np.arange(curve.tau_start_m, curve.tau_end_m, 0.02), curve.tau_end_m)
        insert(curve_map, curve.evaluate(tau))
    assert len(curve_map) == 1
    after = frozen(curve_map)[0]
    tau = np.linspace(before.tau_start_m + STEP, before.tau_end_m - STEP, 200)
    assert after.evaluate(tau) == pytest.approx(before.evaluate(tau), abs=1e-4)
    assert drawn_points(after) == pytest.approx(drawn_points(before), abs=2e-3)


def noisy(points, sigma, random):
    return points + random.normal(0.0, sigma, points.shape)


def test_a_noisy_wall_seen_many_times_converges():
    random, curve_map = np.random.default_rng(1), new_map()
    for _ in range(200):
        points = line((0, 0), (4, 0), 0.02)
        points[:, 0] += random.uniform(0.0, 0.02)
        insert(curve_map, noisy(points, 0.005, random), sigma_m=0.005)
    assert len(curve_map) == 1
    curve = frozen(curve_map)[0]
    inside = drawn_points(curve)[10:-10]
    # 50 observations count, each of about 5 points a span: 5 mm / sqrt(250) and some to spare
    assert np.sqrt(np.mean(inside[:, 1] ** 2)) < 0.0008
    assert np.abs(inside[:, 1]).max() < 0.0025
    assert curve.tau_end_m - curve.tau_start_m == pytest.approx(4.0, abs=0.06)


def thinned(points, sigma_m):
    return as_clusters(points, sigma_m=sigma_m).coarser(STEP, 0.2 * STEP, sigma_m)


@pytest.mark.parametrize("advance_m", [0.03, 0.2])
def test_extension_without_noise_keeps_unit_speed(advance_m):
    curve_map = new_map()
    for k in range(int(4.0 / advance_m)):
        start = k * advance_m
        insert_clusters(
            curve_map, thinned(line((start, 0), (start + 2, 0), 0.005), 0.0), STILL, SETTINGS
        )
    assert len(curve_map) == 1
    curve = frozen(curve_map)[0]
    assert speeds(curve) == pytest.approx(np.ones(400), abs=1e-3)


@pytest.mark.parametrize("backwards", [False, True])
def test_extension_round_a_bend_keeps_unit_speed(backwards):
    curve_map = new_map()
    starts = np.arange(3.0, 1.0, -0.05)
    for start in starts[::-1] if backwards else starts:
        insert(curve_map, arc((0, 0), 2.0, start, start - 0.8, 0.01))
    assert len(curve_map) == 1
    curve = frozen(curve_map)[0]
    assert speeds(curve) == pytest.approx(np.ones(400), abs=0.01)
    assert np.hypot(*drawn_points(curve).T) == pytest.approx(np.full(400, 2.0), abs=1e-3)
    assert curve.tau_end_m - curve.tau_start_m == pytest.approx(2.0 * (1.95 + 0.8), abs=0.02)


@pytest.mark.parametrize("miss", [0, 4, 8])
def test_points_that_miss_are_bridged(miss):
    """A stripe of points off the wall neither bends nor cuts the curve below it."""
    curve_map = new_map()
    insert(curve_map, line((0, 0), (4, 0)))
    points = line((0, 0), (4, 0))
    points[80 : 80 + miss, 1] += 0.09
    for _ in range(5):
        insert(curve_map, points)
    longest = max(frozen(curve_map), key=lambda curve: curve.tau_end_m - curve.tau_start_m)
    assert longest.tau_end_m - longest.tau_start_m == pytest.approx(4.0, abs=1e-3)
    assert np.abs(drawn_points(longest)[:, 1]).max() < 1e-3


@pytest.mark.parametrize("flip", [1.0, -1.0])
def test_a_run_across_an_end_extends_and_does_not_duplicate(flip):
    curve_map = new_map()
    for start, end in (((0, 0), (4, 0)), ((2, 0), (6, 0)), ((-2, 0), (2, 0)), ((-4, 0), (8, 0))):
        ends = [(flip * start[0], 0), (flip * end[0], 0)]
        insert(curve_map, line(*ends))
    assert len(curve_map) == 1
    curve = frozen(curve_map)[0]
    assert curve.tau_end_m - curve.tau_start_m == pytest.approx(12.0, abs=0.01)
    assert np.sort(drawn_points(curve)[[0, -1], 0]) == pytest.approx(
        np.sort([flip * -4, flip * 8]), abs=1e-4
    )


@pytest.mark.parametrize("thickness", [0.0, 0.03, 0.1])
def test_a_thin_wall_seen_from_both_sides_stays_two_curves(thickness):
    curve_map = new_map()
    for _ in range(10):
        insert(curve_map, line((0, 0), (2, 0)), line((2, thickness), (0, thickness)))
    curves = frozen(curve_map)
    assert len(curves) == 2
    for curve, y in zip(curves, (0.0, thickness), strict=True):
        assert drawn_points(curve)[:, 1] == pytest.approx(np.full(400, y), abs=1e-6)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_insertion_is_equivariant(seed):
    """The lattice belongs to the curve, not to the frame: a turned world gives the turned map."""
    random = np.random.default_rng(seed)
    pose = random.uniform(-3.0, 3.0, 3)
    here, there = new_map(), new_map()
    for k in range(4):
        wall = noisy(line((0.2 * k, 0), (2 + 0.2 * k, 0.5)), 0.002, random)
        insert(here, wall)
        insert(there, wall, pose=pose)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[cos, sin], [-sin, cos]])
    for old, new in zip(live_curves(here), live_curves(there), strict=True):
        assert new[0] == old[0]
        assert new[1] == pytest.approx(old[1] @ turn + pose[:2], abs=1e-6)


def test_an_empty_scan_and_one_of_a_single_spot_change_nothing():
    curve_map = new_map()
    insert(curve_map)
    insert(curve_map, np.zeros((30, 2)))
    insert(curve_map, np.full((3, 2), 1.0))
    assert len(curve_map) == 0
