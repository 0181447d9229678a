"""What the tests of the command line share: logs and a map made once."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from tests.cli.tool import bsmap

SCANS = 40  # with odometry, a few metres
SAMPLES = Path(__file__).parent.parent.parent / "sample_logs"


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    """A folder with run.mcap, run.bag, truth.tum, map.bsm and map.tum of one short run."""
    folder = tmp_path_factory.mktemp("made")
    shutil.copy(SAMPLES / "shapes.truth.tum", folder / "truth.tum")
    for name in ("run.mcap", "run.bag"):
        source = SAMPLES / "shapes.mcap"
        ran = bsmap("scans", source, "-o", name, "--max-scans", SCANS, "-q", cwd=folder)
        assert ran.returncode == 0, ran.stderr
    ran = bsmap("slam", "run.mcap", "-o", "map.bsm", "--traj", "map.tum", "-q", cwd=folder)
    assert ran.returncode == 0, ran.stderr
    return folder


@pytest.fixture
def here(made, tmp_path):
    """A fresh folder with the files of `made`."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    return tmp_path
