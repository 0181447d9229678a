"""A few seconds of fuzzing for each reader; `python -m tests.fuzz` goes on for longer."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.fuzz.targets import TARGETS

ROOT = Path(__file__).parent.parent.parent
SECONDS = int(os.environ.get("BSMAP_FUZZ_SECONDS", "1"))


@pytest.mark.parametrize("name", TARGETS)
def test_the_seeds_are_read(name):
    target = TARGETS[name]()
    assert target.seeds
    for seed in target.seeds:
        target.read(seed)


@pytest.mark.skipif(importlib.util.find_spec("atheris") is None, reason="needs atheris")
@pytest.mark.parametrize("name", TARGETS)
def test_no_bytes_break_a_reader(name, tmp_path):
    ran = subprocess.run(
        [sys.executable, "-m", "tests.fuzz", name, f"-max_total_time={SECONDS}", "-seed=1"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        check=False,
        text=True,
        timeout=SECONDS + 120,
    )
    crashes = [path.read_bytes()[:2000] for path in tmp_path.glob("crash-*")]
    assert ran.returncode == 0, f"{ran.stderr[-3000:]}\n{crashes}"
    assert "Done" in ran.stderr
