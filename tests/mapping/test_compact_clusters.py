"""What a keyframe keeps of its clusters is all that is needed to match them again."""

import numpy as np
import pytest

from bsmap_cli.mapping.compact_clusters import MOST_RETURNS, CompactClusters, unpack_scans
from tests.mapping.walls import STEP, arc, as_clusters, line

SIGMA_M = 0.005


def three_surfaces():
    """Of 51, 3 and 24 points."""
    parts = line((2, -0.5), (2, 0.5)), line((9, 1), (9, 1.5), 0.25), arc((5, 5), 1.0, 0.0, 0.46)
    return as_clusters(*parts, sigma_m=SIGMA_M)


def test_clusters_come_back():
    clusters = three_surfaces()
    again = CompactClusters.pack(clusters).unpack(STEP, SIGMA_M)
    assert again.points == pytest.approx(clusters.points, abs=1e-6)
    assert again.tangents == pytest.approx(clusters.tangents, abs=1e-5)
    assert np.array_equal(again.counts, clusters.counts)
    assert np.array_equal(again.starts, clusters.starts)


@pytest.mark.parametrize(("fewest", "sizes"), [(3, [51, 3, 24]), (4, [51, 24]), (100, [])])
def test_clusters_of_too_few_returns_stay_away(fewest, sizes):
    clusters = three_surfaces()
    again = unpack_scans([CompactClusters.pack(clusters)], STEP, SIGMA_M, fewest=fewest).clusters
    assert np.diff(again.starts).tolist() == sizes
    assert len(again.points) == len(again.tangents) == len(again.counts) == sum(sizes)
    assert (again.points[:, 0] > 8.9).sum() == (3 if 3 in sizes else 0)


def test_more_returns_than_a_count_can_tell():
    clusters = three_surfaces()
    clusters.counts[:] = 1e6
    again = CompactClusters.pack(clusters).unpack(STEP, SIGMA_M)
    assert again.counts.tolist() == [MOST_RETURNS] * len(clusters.points)


def test_scans_unpacked_together_are_those_unpacked_alone():
    first, nothing = three_surfaces(), as_clusters(sigma_m=SIGMA_M)
    packed = [CompactClusters.pack(scan) for scan in (first, nothing, first.coarser(0.2, 0.1, 0))]
    together = unpack_scans(packed, STEP, SIGMA_M)
    assert len(together) == 3
    for scan, alone in zip(together, packed, strict=True):
        expected = alone.unpack(STEP, SIGMA_M)
        for name in ("points", "tangents", "counts", "starts"):
            assert np.array_equal(getattr(scan, name), getattr(expected, name))
