"""A disk without room: one line, exit 1, and neither a partial file nor the old one harmed."""

from __future__ import annotations

import resource
import subprocess

import pytest

from tests.cli.tool import BSMAP, bsmap, environment, message, names
from tests.logs.making import MAKERS, some_scans

RUNS = {
    "m.bsm": ("slam", "run.mcap", "-o", "m.bsm", "--traj", "t.tum", "-q"),
    "big.mcap": ("scans", "run.mcap", "-o", "big.mcap"),
    "big.bag": ("scans", "run.mcap", "-o", "big.bag"),
    "big.csv": ("scans", "run.mcap", "-o", "big.csv"),
    "made.mcap": ("sim", "wall", "-o", "made.mcap", "--truth", "made.tum"),
    "map.json": ("export", "map.bsm", "-o", "map.json"),
    "page.html": ("view", "map.bsm", "-o", "page.html"),
}


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 64 KiB with 4 KiB left."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    try:
        subprocess.run(mount, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("needs the right to mount a small file system")
    try:
        (folder / "filler").write_bytes(bytes(60 * 1024))
        yield folder
    finally:
        subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize("target", RUNS)
def test_a_limit_on_file_sizes(target, here):
    """What a user without rights can have of a full disk: writes fail beyond two kilobytes."""
    before = names(here)
    ran = subprocess.run(
        [BSMAP, *RUNS[target]],
        cwd=here,
        capture_output=True,
        check=False,
        env=environment(),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (2048, 2048)),
    )
    assert ran.returncode == 1
    place = "" if target.endswith("bag") else f"{target}: "  # bags are made in a temporary folder
    assert message(ran) == f"error: {place}File too large: write elsewhere with --output"
    assert names(here) == before


@pytest.mark.parametrize("target", RUNS)
def test_a_full_disk(target, here, small_disk):
    paths = (small_disk / part if part in (target, "made.tum") else part for part in RUNS[target])
    ran = bsmap(*paths, cwd=here)
    assert ran.returncode == 1
    assert message(ran).startswith(f"error: {small_disk}/{target}: No space left on device: make")
    assert names(small_disk) == ["filler"]
    assert "t.tum" not in names(here)


def test_the_old_file_stays(here, small_disk):
    (small_disk / "old.mcap").write_bytes(b"old")
    ran = bsmap("scans", "run.mcap", "-o", small_disk / "old.mcap", "--force", cwd=here)
    assert ran.returncode == 1
    assert (small_disk / "old.mcap").read_bytes() == b"old"
    assert names(small_disk) == ["filler", "old.mcap"]


def test_a_device_without_room(here):
    before = names(here)
    for verb in (["slam", "run.mcap", "-q"], ["scans", "run.mcap", "--format", "mcap"]):
        ran = bsmap(*verb, "-o", "/dev/full", cwd=here)
        assert ran.returncode == 1
        assert message(ran).startswith("error: /dev/full: No space left on device")
    assert names(here) == before


def test_no_room_for_temporary_files(small_disk, tmp_path):
    """A database that comes through a pipe is copied first."""
    data = MAKERS["lone db3"](tmp_path / "log", some_scans(80, 361)).read_bytes()
    ran = bsmap("scans", "-o", tmp_path / "x.csv", stdin=data, TMPDIR=str(small_disk))
    assert ran.returncode == 1
    assert "no room for a copy of standard input" in message(ran)
    assert "TMPDIR" in message(ran)
    assert not (tmp_path / "x.csv").exists()
    assert names(small_disk) == ["filler"]
