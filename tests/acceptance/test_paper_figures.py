"""The figures that the method promises, on whole simulated drives without odometry."""

from __future__ import annotations

import io
from functools import cache

import pytest

from bsmap_cli.evaluation.map_quality import map_quality
from bsmap_cli.evaluation.map_statistics import map_statistics
from bsmap_cli.mapping.map_file import write_map
from bsmap_cli.sensor.simulator.simulation import simulate
from tests.acceptance.driving import end_of, hit_surfaces, mapped, slam
from tests.mapping.plain_reader import read_bsm


@cache
def drive(scene, noise_m=0.01, seed=0):
    return simulate(scene, noise_m=noise_m, seed=seed, odometry=False)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("scene", ["wall", "spin"])
def test_a_map_with_true_poses_lies_on_the_true_surfaces(scene, seed):
    surfaces, hits = hit_surfaces(drive(scene, seed=seed))
    document = mapped(drive(scene, seed=seed), "ladder=[0.1]")
    quality = map_quality(document.finest, surfaces, hits=hits)
    assert quality.away_rms_m <= 0.002
    assert quality.rms_m <= 0.003
    assert quality.p95_m <= 0.005
    assert quality.coverage >= 0.97
    assert quality.redundancy <= 1.05


def test_slam_follows_a_wall():
    sim = drive("wall")
    end = end_of(slam(sim).trajectory.poses, sim.truth.poses)
    assert end.metres <= 0.0003 * end.way_m
    assert end.degrees <= 0.05


def test_slam_spins_on_the_spot():
    sim = drive("spin")
    end = end_of(slam(sim).trajectory.poses, sim.truth.poses)
    assert end.metres <= 0.003
    assert end.degrees <= 0.05


def test_the_paper_s_profile_follows_a_wall_without_noise_as_the_paper_says():
    sim = drive("wall", noise_m=0.0)
    end = end_of(slam(sim, "paper").trajectory.poses, sim.truth.poses)
    assert end.metres <= 0.002 * end.way_m
    assert end.degrees < 1.0


def test_the_paper_s_profile_spins_without_noise_as_the_paper_says():
    sim = drive("spin", noise_m=0.0)
    end = end_of(slam(sim, "paper").trajectory.poses, sim.truth.poses)
    assert end.degrees < 1.0


@pytest.fixture(scope="module")
def shapes():
    """The map of Fig. 3 and its file."""
    document = mapped(drive("shapes"), "ladder=[0.2]")
    stream = io.BytesIO()
    return document, write_map(stream, document), stream.getvalue()


def test_curves_take_a_tenth_of_a_grid(shapes):
    document, sizes, _ = shapes
    assert map_statistics(document, sizes).ratio_to_grid_5cm >= 10.0


def test_the_file_takes_the_bytes_of_the_paper_s_accounting(shapes):
    document, sizes, data = shapes
    curves, points = len(document.finest), len(document.finest.weights)
    assert sizes.level_bytes == (24 * curves + 9 * points,)
    ((step, records, knots, control_points, weights),) = read_bsm(data)["levels"]
    assert step == 0.2
    assert (len(records), len(knots)) == (curves, curves)
    assert (len(control_points), len(weights)) == (points, points)
