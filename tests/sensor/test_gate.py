"""Which beams count, where they lie, and what noise they carry."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.gate import (
    SensorSettings,
    find_returns,
    range_limits,
)
from bsmap_cli.sensor.range_noise import RangeNoise, estimate_range_sigma
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.simulator.simulation import simulate

STEP = 0.1
DEFAULT = SensorSettings()


def scan_of(ranges, first_deg=-90.0, step_deg=1.0, **rest):
    return Scan(
        stamp_ns=0,
        ranges_m=np.asarray(ranges, np.float32),
        angle_min_rad=math.radians(first_deg),
        angle_increment_rad=math.radians(step_deg),
        **rest,
    )


CODES = [0.0, -1.0, np.nan, np.inf, -np.inf, 10.0, 9.99, 0.01, 81.91, 1e30]
readings = st.lists(st.one_of(st.sampled_from(CODES), st.floats(0.05, 9.9)), max_size=60)


@given(readings, st.floats(-180, 180), st.tuples(*[st.floats(-3, 3)] * 3))
@settings(max_examples=150, deadline=None)
def test_returns_equal_a_naive_gate(ranges, first_deg, mount):
    scan = scan_of(
        ranges, first_deg, range_min_m=0.05, range_max_m=10.0, pose_base_laser=SE2(*mount)
    )
    expected = []
    for i, reading in enumerate(np.asarray(ranges, np.float32).astype(float)):
        if 0.05 <= reading <= 9.7:  # beyond, readings err to one side, or are codes
            angle = math.radians(first_deg) + i * math.radians(1.0)
            expected.append((reading * math.cos(angle), reading * math.sin(angle)))
    points = SE2(*mount).transform(np.array(expected).reshape(-1, 2))
    returns = find_returns(scan, DEFAULT, STEP)
    assert returns.points_body == pytest.approx(points, abs=1e-9)
    assert len(returns) == len(expected)
    assert returns.beam_step_rad == scan.angle_increment_rad


def test_walls_do_not_bend_where_they_leave_the_sight():
    """Of a wall beside a lidar that sees 4 m far and errs by 1 %, read to the limit and not."""
    angles = np.radians(np.arange(140.0, 170.0, 0.01))
    true = 1.0 / np.sin(angles)
    random, limit_m, errors = np.random.default_rng(1), 4.0, {"fair": [], "last": []}
    for _ in range(20):
        ranges = true * (1.0 + 0.01 * random.normal(size=len(true)))
        ranges[(true > limit_m) | (ranges > limit_m)] = np.inf
        scan = scan_of(ranges, 140.0, 0.01, range_max_m=limit_m)
        returns = find_returns(scan, DEFAULT, STEP)
        off = (scan.ranges_m - true)[returns.beams]
        errors["fair"].append(off[returns.ranges_m > returns.ranges_m.max() - 0.1])
        errors["last"].append((scan.ranges_m - true)[(ranges > 3.9) & np.isfinite(ranges)])
    fair, last = (np.concatenate(errors[name]) for name in ("fair", "last"))
    assert abs(fair.mean()) < 0.005 < last.mean()  # [m]; one reading errs by 0.04


@pytest.mark.parametrize("code", [np.nan, np.inf, -np.inf, 0.0, -1.0, 10.0, 9.99])
def test_codes_for_no_return_give_an_empty_scan(code):
    assert len(find_returns(scan_of([code] * 50, range_max_m=10.0), DEFAULT, STEP)) == 0


def test_a_log_without_a_limit_counts_up_to_300_knot_steps():
    assert range_limits(scan_of([1.0]), DEFAULT, STEP)[1] == pytest.approx(30.0)
    assert range_limits(scan_of([1.0]), DEFAULT, 1.0)[1] == pytest.approx(300.0)
    for stated in (0.0, math.nan, math.inf, -5.0):
        far = range_limits(scan_of([1.0], range_max_m=stated), DEFAULT, STEP)[1]
        assert far == pytest.approx(30.0)


def test_settings_tighten_the_limits_of_the_log_and_never_widen_them():
    given_log = scan_of([1.0], range_min_m=0.2, range_max_m=20.0)
    tight = SensorSettings(range_min_m=0.5, range_max_m=8.0)
    assert range_limits(given_log, tight, STEP) == (0.5, 8.0)
    wide = SensorSettings(range_min_m=0.1, range_max_m=50.0)
    assert range_limits(given_log, wide, STEP) == pytest.approx((0.2, 19.4))


sectors = st.lists(st.tuples(st.floats(-400, 400), st.floats(0.5, 170.0)), max_size=3)


@given(sectors)
@settings(max_examples=80, deadline=None)
def test_ignored_sectors_are_left_out_across_the_seam_too(drawn):
    ignored = tuple((start, start + width) for start, width in drawn)
    beams = find_returns(
        scan_of(np.full(360, 2.0), -180.0), SensorSettings(ignore_angles_deg=ignored), STEP
    )
    kept = np.degrees(np.arctan2(beams.points_body[:, 1], beams.points_body[:, 0]))
    for degrees in range(-180, 180):
        inside = any((degrees - start) % 360.0 < width - 1e-6 for start, width in drawn)
        edge = any(
            min(abs((degrees - e + 180.0) % 360.0 - 180.0) for e in (start, start + width)) < 1e-6
            for start, width in drawn
        )
        if not edge:
            near = np.abs((kept - degrees + 180.0) % 360.0 - 180.0).min(initial=360.0)
            assert (near < 1e-3) == (not inside)


def test_a_sector_given_across_half_a_turn():
    settings_ = SensorSettings(ignore_angles_deg=((170.0, -170.0),))
    points = find_returns(scan_of(np.full(360, 2.0), -180.0), settings_, STEP).points_body
    kept = np.degrees(np.arctan2(points[:, 1], points[:, 0]))
    assert np.abs(kept).max() == pytest.approx(169.0)


@given(st.integers(0, 359), st.integers(2, 80))
@settings(max_examples=60, deadline=None)
def test_a_full_circle_starts_behind_its_widest_gap(first, width):
    """A wall that the seam of the sweep would cut stays in one piece."""
    ranges = np.full(360, 3.0)
    ranges[(first + np.arange(width)) % 360] = np.inf
    returns = find_returns(scan_of(ranges, -180.0, range_max_m=10.0), DEFAULT, STEP)
    gaps = np.hypot(*np.diff(returns.points_body, axis=0).T)
    assert gaps.max() < 3.0 * math.radians(1.0) + 1e-6
    behind = math.radians(-180.0 + first + width)
    expected = 3.0 * np.array([math.cos(behind), math.sin(behind)])
    assert returns.points_body[0] == pytest.approx(expected, abs=1e-5)
    assert np.hypot(*returns.points_body.T) == pytest.approx(returns.ranges_m)


def test_a_half_circle_keeps_the_order_of_its_beams():
    ranges = np.full(181, 3.0)
    ranges[90:] = 5.0
    assert find_returns(scan_of(ranges), DEFAULT, STEP).ranges_m == pytest.approx(ranges)


@pytest.mark.parametrize("time_increment_s", [1e-4, -1e-4])
def test_deskew_undoes_an_exact_motion(time_increment_s):
    """A robot that turns and drives past walls; every beam cast from where the base then was."""
    first = np.array([0.4, -0.1, 0.8])  # vx, vy [m/s], omega [rad/s]
    mount, beams = SE2(0.2, 0.05, 0.1), 721
    angles = math.radians(-90.0) + np.arange(beams) * math.radians(0.25)
    elapsed = np.arange(beams) * time_increment_s
    if time_increment_s < 0.0:  # flipped: the last beam of the list was fired first
        elapsed -= elapsed[-1]
    target = np.array([4.0, 1.0])
    ranges, truth = np.empty(beams), np.empty((beams, 2))
    for i in range(beams):
        base = SE2.from_array(first * elapsed[i])
        laser = base @ mount
        # a wall through `target` with normal (-1, -0.2)
        ahead = np.array([math.cos(laser.theta + angles[i]), math.sin(laser.theta + angles[i])])
        normal = np.array([-1.0, -0.2])
        reach = (normal @ (target - (laser.x, laser.y))) / (normal @ ahead)
        ranges[i] = reach if 0.0 < reach < 20.0 else np.inf
        truth[i] = (laser.x, laser.y) + reach * ahead
    hit = np.isfinite(np.asarray(ranges, np.float32)) & (ranges >= 0.01)
    scan = scan_of(ranges, step_deg=0.25, time_increment_s=time_increment_s, pose_base_laser=mount)
    deskewed = find_returns(scan, DEFAULT, STEP, first).points_body
    assert deskewed == pytest.approx(truth[hit], abs=1e-4)
    for skewed in (
        find_returns(scan, SensorSettings(deskew="off"), STEP, first),
        find_returns(scan, DEFAULT, STEP),
    ):
        assert np.abs(skewed.points_body - truth[hit]).max() > 0.02


@pytest.mark.parametrize("noise_m", [0.005, 0.01, 0.02, 0.03])
def test_noise_is_estimated_within_a_fifth(noise_m):
    sim = simulate("shapes", lidar="utm30lx", noise_m=noise_m, seed=3)
    estimates = [
        estimate_range_sigma(scan, DEFAULT, STEP) for scan in itertools.islice(sim.scans(), 10)
    ]
    assert np.array(estimates) == pytest.approx(np.full(10, noise_m), rel=0.2)


def test_noise_is_not_taken_from_walls_seen_aslant():
    """A coarse lidar in a corridor: from beam to beam the range of a straight wall jumps."""
    sim = simulate("corridor", lidar="lms200", noise_m=0.01, seed=3)
    estimates = [
        estimate_range_sigma(scan, DEFAULT, STEP) for scan in itertools.islice(sim.scans(), 20)
    ]
    assert np.median(estimates) == pytest.approx(0.01, rel=0.1)


def test_noise_is_not_settled_by_where_a_log_begins():
    """A campus seen from a lonely place, then from among its buildings."""
    sim = simulate("campus", lidar="lms200", noise_m=0.01, seed=3)
    noise = RangeNoise(DEFAULT, STEP)
    for scan in itertools.islice(sim.scans(), 0, 4000, 10):
        sigma_m = noise.observe(scan)
    assert sigma_m == pytest.approx(0.01, rel=0.4)


@pytest.mark.parametrize("ranges", [[], [1.0], [np.nan] * 500, [1.0] * 20])
def test_noise_of_too_few_returns_is_unknown(ranges):
    assert estimate_range_sigma(scan_of(ranges), DEFAULT, STEP) is None


@pytest.mark.parametrize(
    ("sector", "left"),
    [
        ((10.0, 20.0), 350),
        ((-10.0, 10.0), 340),
        ((350.0, 10.0), 340),
        ((10.0, -10.0), 20),
        ((0.0, 360.0), 0),
        ((-180.0, 180.0), 0),
        ((0.0, 720.0), 0),
        ((30.0, 30.0), 360),
    ],
)
def test_beams_in_a_sector_are_ignored(sector, left):
    scan = scan_of([2.0] * 360, -179.5)
    settings = SensorSettings(ignore_angles_deg=(sector,))
    assert len(find_returns(scan, settings, STEP)) == left
