"""Table I and eqs. (12)(13) of the paper, written out with 1-based indices, against the merge."""

import numpy as np
import pytest

from bsmap_cli.geometry.curve import Curve
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.curve_merge import covered_share, merge_curve
from bsmap_cli.mapping.merging import MergingSettings

STEP = 0.2


def curve(first, points, degree=3):
    """A curve whose whole domain data support."""
    return Curve(
        degree=degree,
        knot_step_m=STEP,
        first_index=first,
        control_points=np.asarray(points, float),
        weights=np.ones(len(points)),
        tau_start_m=(first + degree) * STEP,
        tau_end_m=(first + len(points)) * STEP,
    )


def map_with(first, points, alphas, degree=3):
    """A map of one curve with the given weights."""
    curve_map = CurveMap(STEP, degree)
    assert (
        merge_curve(curve_map, -1, curve(first, points, degree), MergingSettings(method="table"))
        == 0
    )
    rows = slice(int(curve_map.arrays.offset[0]), int(curve_map.arrays.offset[0]) + len(points))
    curve_map.arrays.weights[rows] = alphas
    return curve_map


def table_1(i_m, c_m, alpha_m, i_k, c_k, d, gamma):
    """I_new, c_new and alpha_new as the paper has them, indices from 1, errata mended.

    Mended: the average takes the updated weight; row 3 takes alpha at j + u_4 - I_m.
    """
    n_m, n_k = len(c_m) + d + 1, len(c_k) + d + 1
    c_m, alpha_m, c_k = [None, *c_m], [None, *alpha_m], [None, *c_k]
    i_ws = d + max(i_m, i_k)  # Property 4
    n_ws = min(n_m + i_m, n_k + i_k) - i_ws - d
    i_new, n_new = min(i_m, i_k), n_m + n_k - n_ws - 2 * d  # (13)
    u1 = i_ws - min(i_m, i_k)
    u2 = u1 + n_ws - d - 1
    u3 = max(n_m + i_m, n_k + i_k) - min(i_m, i_k) - d - 1
    u4 = min(i_m, i_k)
    assert u3 == n_new - d - 1
    points, alphas = [], []
    for j in range(1, u3 + 1):
        if j <= u1:
            points.append(c_m[j] if i_m <= i_k else c_k[j])
            alphas.append(alpha_m[j] if i_m <= i_k else 1)
        elif j <= u2:
            at = j - u1 + i_ws
            alpha = min(gamma, alpha_m[at - i_m] + 1)
            points.append(((alpha - 1) * c_m[at - i_m] + c_k[at - i_k]) / alpha)
            alphas.append(alpha)
        elif n_m + i_m >= n_k + i_k:
            points.append(c_m[j + u4 - i_m])
            alphas.append(alpha_m[j + u4 - i_m])
        else:
            points.append(c_k[j + u4 - i_k])
            alphas.append(1)
    return i_new, np.array(points), np.array(alphas, float)


def random_pair(random, degree):
    """Two curves that share a domain long enough for the table (N_ws >= 1)."""
    while True:
        i_m, i_k = (int(value) for value in random.integers(-20, 20, 2))
        n_m, n_k = (int(value) for value in random.integers(degree + 1, 30, 2))
        if min(i_m + n_m, i_k + n_k) - max(i_m, i_k) - 2 * degree >= 1:
            return i_m, random.normal(size=(n_m, 2)), i_k, random.normal(size=(n_k, 2))


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_table_1_rows(degree):
    random = np.random.default_rng(degree)
    for _ in range(500 if degree == 3 else 50):
        i_m, c_m, i_k, c_k = random_pair(random, degree)
        alphas = random.integers(1, 51, len(c_m)).astype(float)
        wanted_first, wanted, wanted_alphas = table_1(i_m, c_m, alphas, i_k, c_k, degree, 50)
        curve_map = map_with(i_m, c_m, alphas, degree)
        settings = MergingSettings(method="table", max_weight=50)
        merge_curve(curve_map, 0, curve(i_k, c_k, degree), settings)
        merged = curve_map.curve(0)
        assert merged.first_index == wanted_first
        np.testing.assert_allclose(merged.control_points, wanted, atol=1e-12)
        np.testing.assert_array_equal(merged.weights, wanted_alphas)


def test_the_weight_that_is_printed_would_forget_the_first_observation():
    """c_ws with the weight before the update gives the mean of observations 2 .. K."""
    random = np.random.default_rng(1)
    seen = random.normal(size=(6, 12, 2))
    curve_map, settings = map_with(0, seen[0], np.ones(12)), MergingSettings(method="table")
    for points in seen[1:]:
        merge_curve(curve_map, 0, curve(0, points), settings)
    inner = slice(3, 9)
    merged = curve_map.curve(0).control_points[inner]
    np.testing.assert_allclose(merged, seen[:, inner].mean(axis=0), atol=1e-12)
    assert np.abs(merged - seen[1:, inner].mean(axis=0)).max() > 0.01


def test_a_saturated_weight_fades_the_past_out():
    curve_map = map_with(0, np.zeros((12, 2)), np.full(12, 50.0))
    settings = MergingSettings(method="table", max_weight=50)
    merge_curve(curve_map, 0, curve(0, np.ones((12, 2))), settings)
    merged = curve_map.curve(0)
    np.testing.assert_allclose(merged.control_points[3:9], 1 / 50)
    np.testing.assert_array_equal(merged.control_points[[0, 1, 2, 9, 10, 11]], 0.0)
    assert merged.weights.max() == 50


def test_where_the_table_says_nothing_the_map_stands_and_only_grows():
    random = np.random.default_rng(7)
    for _ in range(200):
        i_m, n_m, n_k = 0, int(random.integers(4, 10)), int(random.integers(4, 10))
        i_k = int(random.integers(-n_k + 1, n_m))
        if min(i_m + n_m, i_k + n_k) - max(i_m, i_k) > 6:
            continue  # the table holds
        c_m, c_k = random.normal(size=(n_m, 2)), random.normal(size=(n_k, 2))
        curve_map = map_with(i_m, c_m, np.full(n_m, 7.0))
        merge_curve(curve_map, 0, curve(i_k, c_k), MergingSettings(method="table"))
        merged = curve_map.curve(0)
        at = i_m - merged.first_index
        np.testing.assert_array_equal(merged.control_points[at : at + n_m], c_m)
        np.testing.assert_array_equal(merged.weights[at : at + n_m], 7.0)
        assert merged.first_index == min(i_m, i_k)
        assert len(merged.control_points) == max(i_m + n_m, i_k + n_k) - min(i_m, i_k)


def test_eq_12_starts_a_curve_with_weights_of_one():
    points = np.random.default_rng(3).normal(size=(9, 2))
    curve_map = CurveMap(STEP, 3)
    assert merge_curve(curve_map, -1, curve(-4, points), MergingSettings(method="table")) == 0
    assert merge_curve(curve_map, -1, curve(5, points), MergingSettings(method="table")) == 1
    started = curve_map.curve(1)
    np.testing.assert_array_equal(started.control_points, points)
    np.testing.assert_array_equal(started.weights, 1.0)
    assert started.first_index == 5


def test_merging_commutes_with_evaluation_where_both_are_averaged():
    random = np.random.default_rng(5)
    c_m, c_k = random.normal(size=(20, 2)), random.normal(size=(20, 2))
    curve_map = map_with(0, c_m, np.full(20, 4.0))
    merge_curve(curve_map, 0, curve(2, c_k), MergingSettings(method="table"))
    tau = np.linspace((5 + 3) * STEP, 17 * STEP, 50)  # spans whose four points lie in [5, 17)
    wanted = (4 * curve(0, c_m).evaluate(tau) + curve(2, c_k).evaluate(tau)) / 5
    np.testing.assert_allclose(curve_map.curve(0).evaluate(tau), wanted, atol=1e-12)


def test_the_covered_share_is_one_inside_and_less_at_the_ends():
    points = np.column_stack((np.arange(12.0), np.zeros(12)))
    whole = curve(0, points)
    part = Curve(
        degree=3,
        knot_step_m=STEP,
        first_index=0,
        control_points=points,
        weights=np.ones(12),
        tau_start_m=whole.tau_start_m,
        tau_end_m=whole.tau_end_m - 0.9 * STEP,
    )
    share = covered_share(part, CurveMap(STEP, 3).matrix)
    np.testing.assert_allclose(share[3:8], 1.0, atol=1e-3)
    assert np.all(np.diff(share[7:]) < 0)
    assert share.sum() == pytest.approx((part.tau_end_m - part.tau_start_m) / STEP)


def test_shares_average_what_the_table_would_replace():
    """Both merges agree inside; by shares a curve that goes on does not replace the map's end."""
    points = np.column_stack((np.arange(12.0), np.zeros(12)))
    moved = points + np.array([0.0, 1.0])
    by_share, by_table = (map_with(0, points, np.ones(12)) for _ in range(2))
    merge_curve(by_share, 0, curve(4, moved), MergingSettings(method="fractional"))
    merge_curve(by_table, 0, curve(4, moved), MergingSettings(method="table"))
    shared, table = by_share.curve(0), by_table.curve(0)
    np.testing.assert_allclose(shared.control_points[7:9], table.control_points[7:9], atol=1e-2)
    assert np.all(table.control_points[9:12, 1] == 1.0)
    assert np.all(shared.control_points[9:12, 1] < 0.6)
