"""Scans that enter a map together are scans that enter it one after the other."""

import numpy as np
import pytest

from bsmap_cli.mapping.compact_clusters import BATCH, CompactClusters
from bsmap_cli.mapping.insertion import draw_scans, insert_clusters
from bsmap_cli.mapping.mapping_settings import MappingSettings
from tests.mapping.walls import arc, as_clusters, line, new_map

SETTINGS = MappingSettings()
SIGMA_M = 0.005


def scans(count):
    """Of a wall and a half pillar, each from farther on; every tenth sees nothing."""
    random = np.random.default_rng(5)
    for k in range(count):
        parts = line((0, 2), (3, 2)), arc((1, 4), 0.5, 0.0, 3.0)
        noisy = [part + random.normal(0.0, SIGMA_M, part.shape) for part in parts]
        seen = as_clusters(*([] if k % 10 == 9 else noisy), sigma_m=SIGMA_M)
        yield CompactClusters.pack(seen), np.array([0.1 * k, 0.0, 0.0])


@pytest.mark.parametrize("above", [0, 1])
def test_a_batch_draws_what_its_scans_draw_one_by_one(above):
    packed, poses = zip(*scans(BATCH + 7), strict=True)
    step = SETTINGS.ladder[-1 - above]
    together, alone = new_map(step), new_map(step)
    draw_scans(together, packed, np.array(poses), SETTINGS, SIGMA_M, above=above)
    for scan, pose in zip(packed, poses, strict=True):
        clusters = scan.unpack(SETTINGS.ladder[-1], SIGMA_M)
        if above:
            clusters = clusters.coarser(step, SETTINGS.fitting.thinning * step, SIGMA_M)
        insert_clusters(alone, clusters, pose, SETTINGS)
    assert len(together) == len(alone) > 1
    for k in range(len(alone)):
        one, other = together.curve(k), alone.curve(k)
        assert one.first_index == other.first_index
        assert np.array_equal(one.control_points, other.control_points)
        assert np.array_equal(one.weights, other.weights)
