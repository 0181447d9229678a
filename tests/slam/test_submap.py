"""The coarser levels of a submap, drawn when they are asked for."""

import numpy as np
import pytest

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.compact_clusters import CompactClusters
from bsmap_cli.mapping.scan_levels import ScanLevels
from bsmap_cli.slam.likelihood import sample_surfaces
from bsmap_cli.slam.slam_settings import SlamSettings
from bsmap_cli.slam.submap_levels import SubmapLevels
from tests.slam.rooms import room_parts, seen_from, signed_distance

SETTINGS = SlamSettings()
SIGMA_M = 0.005


def keyframes():
    """Clusters of a room from five places, and the places."""
    for k in range(5):
        pose = SE2(2.0 + 0.3 * k, 2.0, 0.1 * k)
        finest = seen_from(pose, room_parts(), step=SETTINGS.ladder[-1])
        yield ScanLevels(finest, SETTINGS.ladder, SETTINGS.fitting, SIGMA_M), pose.as_array()


def drawn(*, asking_after):
    """The levels of a submap whose coarser ones are asked for after these keyframes."""
    levels = SubmapLevels(SETTINGS)
    for k, (clusters, pose) in enumerate(keyframes()):
        levels.insert(clusters, CompactClusters.pack(clusters[-1]), pose, SIGMA_M)
        if k in asking_after:
            assert len(levels[0]) > 0
    return levels


@pytest.mark.parametrize("level", [0, 1, -1])
def test_whenever_a_coarse_level_is_asked_for_it_is_the_same(level):
    early, late = drawn(asking_after=range(5))[level], drawn(asking_after=())[level]
    assert len(early) == len(late) > 0
    for index in range(len(early)):
        one, other = early.curve(index), late.curve(index)
        assert np.array_equal(one.control_points, other.control_points)
        assert np.array_equal(one.weights, other.weights)


def test_a_submap_has_one_level_for_each_knot_step():
    levels = drawn(asking_after=())
    assert len(levels) == len(SETTINGS.ladder)
    assert [level.knot_step_m for level in levels] == list(SETTINGS.ladder)
    assert [level.knot_step_m for level in levels[1:]] == list(SETTINGS.ladder[1:])
    with pytest.raises(IndexError):
        levels[3]


@pytest.mark.parametrize("level", [0, 1])
def test_a_finished_submap_draws_its_coarser_levels_from_fewer_keyframes(level):
    """And shows the same walls: keyframes are as close as the finest level needs them."""
    full, sparse = drawn(asking_after=()), drawn(asking_after=())
    sparse.finish()
    every, few = (sample_surfaces(levels[level], 0.02)[0] for levels in (full, sparse))
    assert sparse[level].arrays.weights.max() < full[level].arrays.weights.max()
    assert np.abs(signed_distance(few)).max() < 0.1 * SETTINGS.ladder[level]
    apart = np.hypot(*(every[:, None] - few[None]).transpose(2, 0, 1)).min(axis=1)
    assert apart.max() < SETTINGS.ladder[level]


def memory(levels):
    """Bytes of all levels, not asking for any."""
    return sum(array.nbytes for level in levels._levels for array in level.arrays)


def test_a_folded_submap_is_small_and_shows_the_same_whenever_it_is_asked():
    levels = drawn(asking_after=())
    levels.fold()  # nothing: more may be inserted
    assert not levels[-1].folded
    levels.finish()
    opened = [level.arrays for level in levels]
    full = memory(levels)
    for _ in range(2):
        levels.fold()
        assert memory(levels) < 0.3 * full
        for level, before in zip(levels, opened, strict=True):
            for name in before._fields:
                if name not in ("span_cell", "cell_keys", "cell_heads"):  # slots of a hash
                    assert np.array_equal(getattr(level.arrays, name), getattr(before, name))
