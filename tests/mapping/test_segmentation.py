"""Which returns are one surface: eq. (3), and what lost and stray beams do not change about it."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.config import load_settings
from bsmap_cli.mapping.segmentation import SegmentationSettings, find_clusters, segmentation_rule
from bsmap_cli.sensor.gate import SensorSettings, fan_of
from bsmap_cli.sensor.scan import Scan

STEP = 0.1
SIGMA = 0.01
FINE = 0.004  # so little noise never makes a gap of its own
BEAMS = np.radians(np.arange(-90.0, 90.25, 0.5))
DEFAULT = SegmentationSettings()
AS_PRINTED = load_settings("paper").segmentation


def clusters_of(ranges, rule=DEFAULT, sigma_m=SIGMA):
    scan = Scan(
        stamp_ns=0,
        ranges_m=np.asarray(ranges, np.float32),
        angle_min_rad=BEAMS[0],
        angle_increment_rad=BEAMS[1] - BEAMS[0],
        range_max_m=20.0,
    )
    fan = fan_of(scan, SensorSettings(), STEP)
    found = segmentation_rule(fan, rule, knot_step_m=STEP, bin_m=0.0, sigma_m=sigma_m)
    return find_clusters(scan.ranges_m, found)


def room(seed, noise_m=SIGMA):
    """Three walls of a room, 2 m to the sides and 3 m ahead, with noise: one surface."""
    with np.errstate(divide="ignore"):
        front = 3.0 / np.maximum(np.cos(BEAMS), 1e-12)
        sides = 2.0 / np.maximum(np.abs(np.sin(BEAMS)), 1e-12)
    return np.minimum(front, sides) + noise_m * np.random.default_rng(seed).normal(size=len(BEAMS))


def in_one(clusters, least):
    assert len(clusters) == 1
    assert len(clusters.points) >= least
    x, y = clusters.points.T
    assert np.minimum(np.abs(x - 3.0), np.abs(np.abs(y) - 2.0)).max() < 0.06


def test_a_room_is_one_surface():
    in_one(clusters_of(room(0)), len(BEAMS) - 2)


CORNERS = np.searchsorted(BEAMS, [-math.atan2(2.0, 3.0), math.atan2(2.0, 3.0)])
BESIDE = (
    DEFAULT.min_points
)  # what is left of a wall between a stray and the corner may be too short
on_a_wall = st.integers(10, len(BEAMS) - 11).filter(lambda beam: abs(CORNERS - beam).min() > BESIDE)


@given(st.integers(0, 1000), on_a_wall, st.floats(0.1, 15.0))
@settings(max_examples=200, deadline=None)
def test_a_beam_astray_cuts_no_wall_and_bends_none(seed, beam, reading):
    """In a corner it may; nearer than two gaps of eq. (3) it may pass for the noise of a wall."""
    ranges = room(seed, FINE)
    if abs(reading - ranges[beam]) < 2.0 * DEFAULT.max_gap * STEP:
        reading = ranges[beam]
    ranges[beam] = reading
    in_one(clusters_of(ranges, sigma_m=FINE), len(BEAMS) - 3)


@given(st.integers(0, 1000), st.integers(10, len(BEAMS) - 11), st.sampled_from([np.nan, np.inf]))
@settings(max_examples=100, deadline=None)
def test_a_beam_without_return_cuts_no_wall(seed, beam, code):
    ranges = room(seed, FINE)
    ranges[beam] = code
    in_one(clusters_of(ranges, sigma_m=FINE), len(BEAMS) - 3)


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_walls_are_seen_through_scattered_losses(share):
    """Nearly all that returned lies in a few long clusters, though most gaps exceed eq. (3)."""
    for seed in range(20):
        random = np.random.default_rng(seed)
        ranges = room(seed)
        ranges[random.random(len(ranges)) < share] = np.nan
        found = clusters_of(ranges)
        assert len(found) <= 4
        assert len(found.points) >= 0.9 * np.isfinite(ranges).sum()


def test_one_beam_in_twenty_astray_leaves_walls_whole():
    for seed in range(20):
        random = np.random.default_rng(seed)
        ranges = room(seed)
        stray = random.random(len(ranges)) < 0.05
        ranges[stray] = random.uniform(0.1, 18.0, np.count_nonzero(stray))
        assert len(clusters_of(ranges)) <= 3


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_door_stays_open(share):
    """Ten degrees of beams in a row do not fall out by chance."""
    ranges = room(1)
    ranges[np.random.default_rng(1).random(len(ranges)) < share] = np.nan
    ranges[np.abs(np.degrees(BEAMS)) < 5.0] = np.inf
    points = clusters_of(ranges).points
    starts = clusters_of(ranges).starts[1:-1]
    assert (np.sign(points[starts - 1, 1]) < np.sign(points[starts, 1])).any()


def test_a_step_between_two_walls_is_no_lost_beam():
    """Behind a lone silent beam the next surface begins half a metre farther away."""
    ranges = np.where(BEAMS < 0.0, 3.0, 3.5) / np.maximum(np.cos(BEAMS), 1e-12)
    ranges[np.abs(np.degrees(BEAMS)) > 40.0] = np.inf
    ranges[len(BEAMS) // 2] = np.nan
    assert len(clusters_of(ranges)) == 2


def test_as_printed_each_stray_beam_cuts():
    ranges = room(0, noise_m=0.0)
    ranges[len(BEAMS) // 2] = 1.0
    one = clusters_of(room(0, noise_m=0.0), AS_PRINTED)
    two = clusters_of(ranges, AS_PRINTED)
    assert len(two) == len(one) + 1


def test_without_beam_gaps_the_cuts_are_those_of_eq_3():
    rule = dataclasses.replace(DEFAULT, beam_gap=False, min_points=2, min_length=0.0)
    random = np.random.default_rng(3)
    for _ in range(30):
        ranges = 2.0 + np.cumsum(random.normal(0.0, 0.02, len(BEAMS)))
        ranges[random.random(len(BEAMS)) < 0.1] = np.nan
        found = clusters_of(ranges, rule)
        assert found.points == pytest.approx(by_eq_3(ranges, rule), abs=1e-12)


def by_eq_3(ranges, rule):
    """Points of all clusters of two or more, by the inequalities as they stand."""
    ranges = np.asarray(ranges, np.float32).astype(float)
    points = np.column_stack((ranges * np.cos(BEAMS), ranges * np.sin(BEAMS)))
    points = points[np.isfinite(points[:, 0])]
    clusters, before = [[points[0]]], math.inf
    for last, point in itertools.pairwise(points):
        gap = math.dist(last, point)
        if gap <= rule.rel_gap * before and gap <= rule.max_gap * STEP:
            clusters[-1].append(point)
            before = gap
        else:
            clusters.append([point])
            before = math.inf
    return np.array([point for cluster in clusters if len(cluster) > 1 for point in cluster])


def far_wall(beams, range_m):
    """Returns of some beams, half a degree apart, on a wall straight ahead; else none."""
    ranges = np.full(len(BEAMS), np.inf)
    middle = len(BEAMS) // 2
    for k in range(beams):
        beam = middle + k
        ranges[beam] = range_m / math.cos(BEAMS[beam])
    return ranges


def test_three_beams_far_away_are_a_faint_surface_and_near_by_none():
    faint = clusters_of(far_wall(3, 15.0))  # 13 cm from beam to beam
    assert len(faint) == 1
    assert faint.points == pytest.approx(
        faint.points[0] + [[0, 0], [0, 0.131], [0, 0.262]], abs=2e-3
    )
    assert len(clusters_of(far_wall(2, 15.0))) == 0
    assert len(clusters_of(far_wall(3, 3.0))) == 0
    plain = dataclasses.replace(DEFAULT, faint_points=DEFAULT.min_points)
    assert len(clusters_of(far_wall(3, 15.0), plain)) == 0
    assert len(clusters_of(far_wall(5, 15.0), plain)) == 1
