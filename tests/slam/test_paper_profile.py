"""The two missions of the paper, shortened: what its profile reaches, and what it does not."""

import itertools
import math

import numpy as np
import pytest

from bsmap_cli.config import load_settings
from bsmap_cli.evaluation.map_quality import map_quality
from bsmap_cli.evaluation.true_surfaces import cut_surfaces
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.simulator.simulation import simulate
from bsmap_cli.slam import curve_matching, ladder
from bsmap_cli.slam.slam import Slam


def drive(scene, scans, *overrides, profile="paper", noise_m=0.0):
    """Final error [m], [rad], path [m], the result and the simulation, over the first scans."""
    sim = simulate(scene, noise_m=noise_m, odometry=False)
    slam = Slam(load_settings(profile, overrides=overrides))
    for scan in itertools.islice(sim.scans(), scans):
        slam.process(scan)
    result = slam.finish()
    truth = [SE2.from_array(pose) for pose in sim.truth.poses[:scans]]
    moved = truth[0].inverse() @ truth[-1]
    error = moved.inverse() @ SE2.from_array(result.trajectory.poses[-1])
    path_m = float(np.hypot(*np.diff(sim.truth.poses[:scans, :2], axis=0).T).sum())
    return math.hypot(error.x, error.y), abs(error.theta), path_m, result, sim


def test_wall_without_noise():
    metres, radians, path_m, result, _ = drive("wall", 350)
    assert metres <= 0.002 * path_m
    assert math.degrees(radians) < 1.0
    assert len(result.trajectory) == 350
    assert result.figures["submaps"] == 1
    assert result.figures["keyframes"] == 350
    assert result.figures["loops"] == 0


def test_spin_without_noise():
    metres, radians, _, result, sim = drive("spin", 260)
    assert metres <= 0.003
    assert math.degrees(radians) < 1.0
    surfaces = cut_surfaces([surface.points for surface in sim.world.surfaces()])
    start = SE2.from_array(sim.truth.poses[0])
    quality = map_quality(result.document.finest, surfaces, pose_world_map=start)
    assert quality.rms_m < 0.01


@pytest.mark.parametrize("method", ["joint", "points"])
def test_the_other_registrations_run_on_the_paper_s_map(method):
    metres, radians, *_ = drive("spin", 120, f"registration.method={method}")
    assert metres <= 0.003
    assert math.degrees(radians) < 0.2


@pytest.mark.parametrize("method", ["joint", "joint_first", "curve"])
def test_the_method_that_is_set_registers_every_scan(method, monkeypatch):
    called = []

    def noted(*arguments, **rest):
        called.append(method)
        return curve_matching.match_curves(*arguments, **rest)

    monkeypatch.setattr(ladder, "match_curves", noted)
    drive("spin", 30, f"registration.method={method}", profile="default", noise_m=0.01)
    levels = 1 if method == "joint_first" else 3
    assert len(called) >= levels * 29  # all but the first


@pytest.mark.parametrize("method", ["joint", "joint_first", "curve"])
def test_curves_can_be_registered_on_the_map_of_the_default_profile(method):
    metres, radians, *_ = drive(
        "spin", 120, f"registration.method={method}", profile="default", noise_m=0.01
    )
    assert metres <= 0.01
    assert math.degrees(radians) < 0.3


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
@pytest.mark.parametrize("profile", ["paper", "default"])
def test_every_degree(profile, degree):
    metres, radians, _, result, _ = drive("spin", 100, f"degree={degree}", profile=profile)
    assert metres <= 0.003
    assert math.degrees(radians) < 0.2
    assert result.document.degree == degree


def test_the_map_that_tracking_built_holds_the_curves_of_all_submaps():
    _, _, _, result, sim = drive(
        "spin",
        260,
        "submaps.keyframes=8",
        "final_map.rebuild=false",
        "final_map.rounds=0",
        profile="default",
    )
    assert result.figures["submaps"] > 2
    level = result.document.finest
    np.testing.assert_array_equal(level.curve_ids, np.arange(len(level)))
    surfaces = cut_surfaces([surface.points for surface in sim.world.surfaces()])
    start = SE2.from_array(sim.truth.poses[0])
    quality = map_quality(level, surfaces, pose_world_map=start)
    assert quality.rms_m < 0.01
    assert quality.redundancy > 1.2  # what two submaps hold stays double
