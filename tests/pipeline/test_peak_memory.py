"""The peak memory that a report tells is that of the process itself."""

import subprocess
import sys

import pytest

from bsmap_cli.pipeline import peak_memory

CHILD = f"from runpy import run_path; print(run_path({peak_memory.__file__!r})['peak_memory_mb']())"
PARENT = f"""
import subprocess, sys
held = bytearray(b"x") * 200_000_000
command = [sys.executable, "-c", {CHILD!r}]
subprocess.run(command, check=True, preexec_fn=lambda: None)
{CHILD}
"""


@pytest.mark.skipif(not peak_memory.STATUS.exists(), reason="only Linux tells the peak of its own")
def test_a_small_process_started_by_a_large_one_is_small():
    done = subprocess.run(
        [sys.executable, "-c", PARENT], check=True, capture_output=True, text=True
    )
    child, parent = map(float, done.stdout.split())
    assert parent > 200.0
    assert 1.0 < child < 100.0


def test_elsewhere_the_peak_is_that_of_the_resource_usage(monkeypatch, tmp_path):
    own = peak_memory.peak_memory_mb()
    monkeypatch.setattr(peak_memory, "STATUS", tmp_path / "none")
    assert peak_memory.peak_memory_mb() > 0.9 * own
