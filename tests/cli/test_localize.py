"""`bsmap localize`: where the robot was, in the frame of a saved map."""

from __future__ import annotations

import json

import numpy as np
import pytest

from bsmap_cli.exchange.tum import read_tum
from tests.cli.conftest import SAMPLES, SCANS
from tests.cli.tool import bsmap, message, names, shell


def trajectory(path):
    with path.open() as lines:
        return read_tum(lines)


def test_a_log_is_found_in_its_own_map(here):
    ran = bsmap("localize", "run.mcap", "--map", "map.bsm", "--traj", "w.tum", "--json", cwd=here)
    assert ran.returncode == 0, ran.stderr
    report = json.loads(ran.stdout)
    assert list(report) == ["converged_after_scans", "scans", "lost", "seconds"]
    assert (report["scans"], report["lost"]) == (SCANS, 0)
    found, made = trajectory(here / "w.tum"), trajectory(here / "map.tum")
    assert np.array_equal(found.stamps_ns, made.stamps_ns)
    assert np.abs(found.poses - made.poses)[:, :2].max() < 0.05


def test_the_start_may_be_anywhere_and_the_poses_go_to_a_pipe(here):
    line = "cat run.mcap | bsmap localize --map map.bsm --start 6 --traj - -q"
    ran = shell(line, here)
    (here / "w.tum").write_bytes(ran.stdout)
    found, made = trajectory(here / "w.tum"), trajectory(here / "map.tum")
    later = made.poses[-len(found) :]
    assert 0 < len(found) < SCANS
    assert np.abs(found.poses - later)[:, :2].max() < 0.05


def test_a_log_of_elsewhere_ends_with_one_line_and_no_file(here):
    before = names(here)
    elsewhere = SAMPLES / "wall.mcap"
    ran = bsmap(
        *("localize", elsewhere, "--map", "map.bsm", "--traj", "w.tum", "-q", "--max-scans", 20),
        cwd=here,
    )
    assert ran.returncode == 1
    assert "fit no place in the map" in message(ran)
    assert names(here) == before


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["run.mcap"], 2, "--map"),
        (["-", "--map", "-"], 2, "both"),
        (["run.mcap", "--map", "none.bsm"], 1, "none.bsm"),
        (["run.mcap", "--map", "map.bsm", "--traj", "map.bsm"], 2, "also an input"),
        (["run.mcap", "--map", "map.bsm", "--traj", "map.tum"], 2, "--force"),
        (["run.mcap", "--map", "map.bsm", "--traj", "-", "--json"], 2, "--json"),
    ],
)
def test_what_cannot_be_is_refused(arguments, code, words, here):
    ran = bsmap("localize", *arguments, cwd=here)
    assert ran.returncode == code
    assert words in message(ran)
