"""Logs of real robots, from whatever container, where they lie beside the checkout."""

from __future__ import annotations

import json

import numpy as np
import pytest

from bsmap_cli.evaluation.map_statistics import map_statistics, sizes_of
from tests.acceptance.driving import DATA, run_log
from tests.cli.tool import bsmap

pytestmark = pytest.mark.skipif(
    not DATA.is_dir(), reason="no real logs: ../shared/data is not beside the checkout"
)

PART_S = 60.0  # of the log: the whole agrees too, and takes three times as long


@pytest.fixture(scope="module")
def csail():
    return run_log(DATA / "mit-csail.clf.gz", end_s=PART_S)


@pytest.mark.parametrize("name", ["mit-csail_ros1.bag", "mit-csail_ros2_mcap"])
def test_every_container_of_a_log_gives_the_same_result(csail, name):
    run = run_log(DATA / name, end_s=PART_S)
    assert len(run.trajectory) == len(csail.trajectory)
    gap = run.trajectory.poses[:, :2] - csail.trajectory.poses[:, :2]
    assert np.hypot(*gap.T).max() <= 0.01
    figures = [map_statistics(r.document, sizes_of(r.document)) for r in (run, csail)]
    for key in ("curves", "control_points", "payload_bytes", "length_m"):
        assert getattr(figures[0], key) == pytest.approx(getattr(figures[1], key), rel=0.01)


def test_a_tilting_laser_is_no_crash(tmp_path):
    ran = bsmap(
        *("slam", DATA / "tilt_laser.bag", "-o", "m.bsm", "--traj", "t.tum", "--json"),
        cwd=tmp_path,
    )
    assert ran.returncode in (0, 3), ran.stderr
    assert json.loads(ran.stdout)["scans"] == 178
    assert len((tmp_path / "t.tum").read_text().splitlines()) == 178
