"""One compiled call does what prediction, registration and judgement do one by one."""

import math
from dataclasses import replace

import numpy as np
import pytest

from bsmap_cli.config import load_settings
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.simulation import simulate
from bsmap_cli.slam.following import Follower
from bsmap_cli.slam.prediction import (
    LEAST_SIGMA,
    UNTOLD,
    motion_rule,
    moved_on,
    predict,
    unknown_motion,
    worst_sigma_m,
)
from bsmap_cli.slam.registration import register
from bsmap_cli.slam.slam import Slam
from tests.slam.rooms import CENTRE, corridor_parts, map_of, room_parts, seen_from

SETTINGS = load_settings()
UNIT = SETTINGS.ladder[-1]
SIGMA = 0.005
ORIGIN = SE2(3.0, -2.0, 0.7)  # of the map, in the local frame
ROOM, CORRIDOR = map_of(room_parts()), map_of(corridor_parts())
STEP = (0.03, 0.005, 0.01)
ODOMETRY = ((5.0, 1.0, 2.0), tuple(SE2(5.0, 1.0, 2.0) @ SE2(*STEP)))


def seen(parts, pose):
    """A scan from a pose in the map, with noise; a few points are beside all walls."""
    clusters = seen_from(pose, parts)
    noise = SIGMA * np.random.default_rng(3).normal(size=clusters.points.shape)
    clusters.points[:] += noise
    clusters.points[:5] += 3.0
    return clusters


def followed(curve_map, parts, *, odometry, enough=0.6, settings=SETTINGS):
    """The robot stood at the centre, and is a step on."""
    before = unknown_motion(settings.prediction, UNIT)._replace(step=STEP, odometry=odometry[0])
    result = Follower(settings).follow(
        curve_map,
        seen(parts, CENTRE @ SE2(*STEP) @ SE2(0.01, -0.01, 0.002)),
        before,
        odometry[1],
        0.1,
        origin=ORIGIN,
        last=ORIGIN @ CENTRE,
        last_keyframe=ORIGIN @ CENTRE,
        enough=enough,
        sigma_m=SIGMA,
    )
    return before, result


@pytest.mark.parametrize("odometry", [ODOMETRY, (UNTOLD, UNTOLD)], ids=["odometry", "none"])
def test_it_is_what_its_parts_are(odometry):
    before, result = followed(ROOM, room_parts(), odometry=odometry)
    assert result.plain
    rule = motion_rule(SETTINGS.prediction, UNIT)
    prediction = predict(before, odometry[1], 0.1, rule)
    assert np.hstack(result.prediction) == pytest.approx(np.hstack(prediction), abs=1e-12)
    expected = (CENTRE @ SE2(*prediction.step)).as_array()
    match = register(
        ROOM,
        seen(room_parts(), CENTRE @ SE2(*STEP) @ SE2(0.01, -0.01, 0.002)),
        expected,
        expected,
        prediction.information(),
        sigma_m=SIGMA,
        settings=SETTINGS.registration,
    )
    assert result.match.pose == pytest.approx(match.pose, abs=1e-9)
    assert result.match.information == pytest.approx(match.information, rel=1e-6)
    assert result.match[2:] == pytest.approx(match[2:])
    pose = ORIGIN @ SE2.from_array(match.pose)
    assert tuple(result.pose_local) == pytest.approx(tuple(pose), abs=1e-9)
    step = tuple(pose.relative_to(ORIGIN @ CENTRE))
    motion = moved_on(before, step, odometry[1], True, worst_sigma_m(match.information), rule)
    flat = [np.hstack(one) for one in (result.motion, motion)]
    assert flat[0] == pytest.approx(flat[1], abs=1e-9, nan_ok=True)


def test_a_scan_that_is_not_all_there_is_left_to_others():
    before, result = followed(ROOM, room_parts(), odometry=ODOMETRY, enough=math.inf)
    assert not result.plain
    assert result.pose_local == ORIGIN @ CENTRE
    assert np.hstack(result.motion) == pytest.approx(np.hstack(before))
    assert result.match.inlier_ratio > 0.9  # what was found is told all the same


def test_a_scan_that_does_not_tell_the_way_is_left_to_others():
    _, result = followed(CORRIDOR, corridor_parts(), odometry=ODOMETRY)
    assert result.match.degenerate > 0
    assert not result.plain


@pytest.mark.parametrize("distance, due", [(0.2, True), (5.0, False)])
def test_a_keyframe_is_due_after_some_way(distance, due):
    settings = replace(SETTINGS, keyframes=replace(SETTINGS.keyframes, distance=distance))
    _, result = followed(ROOM, room_parts(), odometry=ODOMETRY, settings=settings)
    assert result.due == due


def test_no_prediction_is_so_sure_that_it_cannot_be_weighed():
    """A robot that stands still, and settings that trust its odometry without limit."""
    sure = replace(SETTINGS.prediction, odometry_sigma=0.0, odometry_sigma_deg=0.0)
    motion = unknown_motion(sure, UNIT)._replace(odometry=(1.0, 2.0, 0.5))
    prediction = predict(motion, (1.0, 2.0, 0.5), 0.1, motion_rule(sure, UNIT))
    assert prediction.sigma_m == prediction.sigma_rad == LEAST_SIGMA
    assert np.isfinite(prediction.information()).all()


@pytest.mark.parametrize("told", ["all", "none", "some"])
def test_a_scan_is_tracked_alike_whether_it_is_plain_or_not(told, monkeypatch):
    """On one level the longer way makes the same match, and must leave the same behind."""
    settings = replace(SETTINGS, ladder=(0.1,))
    sim = simulate("spin", lidar="ust10lx", noise_m=0.01, rate_hz=8.0)
    scans = [
        scan if told == "all" or (told == "some" and k % 20 < 12) else without_odometry(scan)
        for k, scan in zip(range(120), sim.scans(), strict=False)
    ]

    def driven():
        slam = Slam(replace(settings, loops=replace(settings.loops, enabled=False)))
        for scan in scans:
            slam.process(scan)
        return slam._local, slam._log

    local, log = driven()
    plainly = Follower.follow
    monkeypatch.setattr(
        Follower, "follow", lambda *a, **k: plainly(*a, **{**k, "enough": math.inf})
    )
    other, other_log = driven()
    assert np.array(log.poses) == pytest.approx(np.array(other_log.poses), abs=1e-7)
    assert log.keyframes == other_log.keyframes
    flat = [np.hstack(one._motion) for one in (local, other)]
    assert flat[0] == pytest.approx(flat[1], abs=1e-6, nan_ok=True)
    for name in ("_lost_scans", "_afresh", "_coasted_m", "_coasted_rad", "_explained", "_overlap"):
        assert getattr(local, name) == pytest.approx(getattr(other, name), abs=1e-9)


def without_odometry(scan):
    return replace(scan, pose_odom_base=None)
