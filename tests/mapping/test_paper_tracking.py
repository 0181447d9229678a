"""Algorithm 1 as printed: centroids (4)(5), and what becomes of a cluster in the map."""

from dataclasses import replace

import numpy as np

from bsmap_cli.config import load_settings
from bsmap_cli.evaluation.map_quality import map_quality
from bsmap_cli.evaluation.true_surfaces import cut_surfaces
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.centroid_tracking import Tracks, cluster_centroids, track_clusters
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.mapper import Mapper
from bsmap_cli.mapping.scan_levels import Segmenter
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.simulator.simulation import simulate
from tests.mapping.walls import arc, insert, line, speeds

PAPER = load_settings("paper")
STEP = 0.1


def tracks(*centroids):
    return Tracks(np.array(centroids, float), np.arange(len(centroids)), np.zeros(len(centroids)))


def test_eq_4_is_the_mean_of_each_cluster():
    points = np.random.default_rng(0).normal(size=(30, 2))
    starts = np.array([0, 4, 21, 30])
    wanted = [points[a:b].mean(axis=0) for a, b in ((0, 4), (4, 21), (21, 30))]
    np.testing.assert_allclose(cluster_centroids(points, starts), wanted, atol=1e-14)
    assert cluster_centroids(np.zeros((0, 2)), np.array([0])).shape == (0, 2)


def test_eq_5_takes_the_nearest_of_the_last_scan_within_reach():
    last = tracks((0.0, 0.0), (1.0, 0.0), (5.0, 5.0))
    centroids = np.array([(0.9, 0.0), (0.05, 0.0), (3.0, 3.0), (5.0, 5.1)])
    np.testing.assert_array_equal(track_clusters(centroids, last, 0.11), [1, 0, -1, 2])
    np.testing.assert_array_equal(track_clusters(centroids, last, 0.04), [-1, -1, -1, -1])
    np.testing.assert_array_equal(track_clusters(centroids, None, 1.0), [-1] * 4)
    np.testing.assert_array_equal(track_clusters(centroids, tracks(), 1.0), [-1] * 4)


def test_a_wall_that_slides_through_view_stays_one_curve_and_grows():
    curve_map = CurveMap(STEP, 3)
    for k in range(60):
        insert(curve_map, line((0.05 * k, 1.0), (3.0 + 0.05 * k, 1.0), 0.013), settings=PAPER)
    assert len(curve_map) == 1
    curve = curve_map.curve(0)
    assert curve.tau_end_m - curve.tau_start_m > 3.0 + 0.9 * 59 * 0.05
    assert (
        np.abs(
            curve.evaluate(np.linspace(curve.tau_start_m, curve.tau_end_m, 300))[:, 1] - 1.0
        ).max()
        < 1e-6
    )
    np.testing.assert_allclose(speeds(curve), 1.0, atol=0.01)
    assert curve.weights.max() == PAPER.merging.max_weight


def test_a_cluster_that_jumps_further_than_gamma_track_becomes_a_new_curve():
    curve_map = CurveMap(STEP, 3)
    insert(curve_map, line((0.0, 1.0), (2.0, 1.0)), settings=PAPER)
    insert(curve_map, line((0.0, 1.0), (2.0 + 0.9 * 2 * STEP, 1.0)), settings=PAPER)
    assert len(curve_map) == 1
    insert(curve_map, line((0.0, 1.0), (3.0, 1.0)), settings=PAPER)
    assert len(curve_map) == 2


def test_only_the_last_scan_is_remembered():
    wall = line((0.0, 1.0), (2.0, 1.0))
    curve_map = CurveMap(STEP, 3)
    for parts in ((wall,), (wall,), (), (wall,)):
        insert(curve_map, *parts, settings=PAPER)
    assert len(curve_map) == 2


def test_every_cluster_keeps_its_own_curve():
    pillar, wall = arc((1.0, 3.0), 0.4, 3.3, 6.1), line((0.0, 1.0), (2.0, 1.0))
    curve_map = CurveMap(STEP, 3)
    for _ in range(5):
        insert(curve_map, wall, pillar, settings=PAPER)
    assert len(curve_map) == 2
    inner = curve_map.curve(1).weights[3:-3]
    np.testing.assert_array_equal(inner, 5.0)


def test_clusters_with_too_few_points_for_a_curve_are_passed_over():
    curve_map = CurveMap(STEP, 3)
    insert(curve_map, line((0.0, 1.0), (0.02, 1.0)), line((1.0, 1.0), (2.0, 1.0)), settings=PAPER)
    insert(curve_map, line((0.0, 1.0), (0.02, 1.0)), line((1.0, 1.0), (2.0, 1.0)), settings=PAPER)
    assert len(curve_map) == 1
    assert curve_map.curve(0).weights.max() == 2.0


def test_each_level_is_segmented_by_its_own_gamma_abs():
    """A round wall of which beams meet a point each 0.2 m: one cluster at Delta = 0.4 m only."""
    scan = Scan(
        stamp_ns=0,
        ranges_m=np.full(40, 10.0, np.float32),
        angle_min_rad=0.0,
        angle_increment_rad=0.02,
    )
    levels = Segmenter(replace(PAPER, ladder=(0.4, 0.1))).levels(scan, 0.01)
    assert [len(level) for level in levels] == [1, 0]
    assert len(levels[0].points) == 40  # nothing is thinned


def test_known_poses_without_noise_give_the_surfaces():
    sim = simulate("spin", noise_m=0.0, odometry=False)
    mapper = Mapper(load_settings("paper", overrides=["ladder=[0.1]"]))
    for scan, pose in zip(sim.scans(), sim.truth.poses[:80], strict=False):
        mapper.insert(scan, SE2.from_array(pose))
    surfaces = cut_surfaces([surface.points for surface in sim.world.surfaces()])
    quality = map_quality(mapper.document().finest, surfaces)
    assert quality.rms_m <= 0.003
    assert quality.p95_m <= 0.005
    assert quality.redundancy <= 1.05
