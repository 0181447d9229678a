"""Kernels that are kept on disk: none outlives a change of what it is made of."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import bsmap_cli

SAMPLES = """
import numpy as np
from bsmap_cli.geometry.basis import basis_matrix
from bsmap_cli.slam.likelihood import _sample

points, directions = np.empty((1, 2)), np.empty((1, 2))
_sample(np.ones((4, 2)), np.zeros(1, np.int64), basis_matrix(3), 1, points, directions)
print(points[0, 0], sum(_sample.stats.cache_hits.values()))
"""


def sampled(folder):
    """What a curve of ones is sampled as, and how many kernels came from the disk."""
    ran = subprocess.run(
        [sys.executable, "-c", SAMPLES],
        cwd=folder,
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder / "kept"), "PYTHONPATH": str(folder)},
        stdout=subprocess.PIPE,
        check=True,
        text=True,
    )
    value, kept = ran.stdout.split()
    return float(value), int(kept)


def test_a_constant_in_the_file_of_a_part_is_not_taken_from_an_old_kernel(tmp_path):
    package = tmp_path / "bsmap_cli"
    shutil.copytree(Path(bsmap_cli.__file__).parent, package)
    assert sampled(tmp_path) == (1.0, 0)
    assert sampled(tmp_path) == (1.0, 1)
    kernels = package / "geometry" / "foot_points.py"
    text = kernels.read_text()
    assert text.count("bx + SIXTH") == 1
    kernels.write_text(text.replace("bx + SIXTH", "1.0 + bx + SIXTH"))
    assert sampled(tmp_path) == (2.0, 0)
