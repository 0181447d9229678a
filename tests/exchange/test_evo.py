"""A trajectory of ours in evo, which judges it as `bsmap eval` does.

evo is never a dependency: the test runs where `evo_ape` is on the path, or named in BSMAP_EVO_APE
(in an environment of its own: `python -m venv evo && evo/bin/pip install evo`).
"""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.cli.tool import bsmap

EVO_APE = os.environ.get("BSMAP_EVO_APE") or shutil.which("evo_ape")
TRUTH = Path(__file__).parent.parent.parent / "sample_logs" / "shapes.truth.tum"
LOG = TRUTH.with_name("shapes.mcap")

pytestmark = pytest.mark.skipif(EVO_APE is None, reason="needs evo_ape: name it in BSMAP_EVO_APE")


def evo_statistics(folder, estimate, *flags):
    """What evo prints of the errors of positions after alignment."""
    ran = subprocess.run(
        [EVO_APE, "tum", TRUTH, estimate, "--align", *flags],
        cwd=folder,
        env={**os.environ, "HOME": str(folder), "MPLBACKEND": "Agg"},
        capture_output=True,
        check=True,
        text=True,
    )
    return {
        name: float(value) for name, value in re.findall(r"^\s*(\w+)\t(\S+)$", ran.stdout, re.M)
    }


def test_evo_reads_a_trajectory_and_finds_the_same_errors(tmp_path):
    ran = bsmap("slam", LOG, "-o", "m.bsm", "--traj", "t.tum", "-q", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    ours = json.loads(bsmap("eval", "t.tum", TRUTH, "--json", cwd=tmp_path).stdout)
    theirs = evo_statistics(tmp_path, "t.tum")
    for name in ("rmse", "mean", "median", "max"):
        assert ours["ate"][f"{name}_m"] == pytest.approx(theirs[name], abs=2e-6)
    turns = evo_statistics(tmp_path, "t.tum", "--pose_relation", "angle_deg")
    assert ours["ate"]["rotation_rmse_deg"] == pytest.approx(turns["rmse"], abs=1e-4)
