"""What holds for every whole run: the same bytes, and the same result at any size."""

from __future__ import annotations

import numpy as np
import pytest

from bsmap_cli.evaluation.map_statistics import drawn_length
from bsmap_cli.mapping.sampling import sample_level
from tests.acceptance.driving import SAMPLES, run_log, write_scaled
from tests.cli.tool import bsmap


def test_the_same_bytes_again_and_on_any_number_of_threads(tmp_path):
    made = []
    for threads, name in (("1", "a"), ("2", "b")):
        log = SAMPLES / "twins.bag"
        ran = bsmap(
            *("slam", log, "-o", f"{name}.bsm", "--traj", f"{name}.tum", "-q"),
            cwd=tmp_path,
            NUMBA_NUM_THREADS=threads,
            PYTHONHASHSEED=threads,
        )
        assert ran.returncode == 0, ran.stderr
        made.append([(tmp_path / f"{name}.{kind}").read_bytes() for kind in ("bsm", "tum")])
    assert made[0] == made[1]


@pytest.mark.parametrize("name", ["spin.bag", "shapes.mcap", "twins.bag"])
def test_ten_times_the_size_gives_ten_times_the_result(name, tmp_path):
    write_scaled(SAMPLES / name, tmp_path / "large.mcap", 10.0)
    small = run_log(SAMPLES / name)
    large = run_log(tmp_path / "large.mcap", "ladder=[4.0,2.0,1.0]")
    poses, large_poses = small.trajectory.poses, large.trajectory.poses
    way_m = np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()
    reach_m = np.ptp(sample_level(small.document.finest, 0.1).points, axis=0).max()
    gap_m = np.hypot(*(0.1 * large_poses - poses)[:, :2].T).max()
    assert gap_m <= 0.01 * max(way_m, reach_m)
    level, large_level = small.document.finest, large.document.finest
    assert len(large_level.weights) == pytest.approx(len(level.weights), rel=0.01)
    assert 0.1 * length_of(large_level) == pytest.approx(length_of(level), rel=0.01)


def length_of(level):
    return drawn_length(sample_level(level, level.knot_step_m / 4))
