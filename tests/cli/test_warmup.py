"""`bsmap warmup`: afterwards nothing is left to be compiled."""

from __future__ import annotations

import json

import pytest

from tests.cli.conftest import SAMPLES
from tests.cli.tool import bsmap, message, names


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """A folder of compiled code made by the command, and what that said."""
    folder = tmp_path_factory.mktemp("cache")
    ran = bsmap("warmup", "--json", NUMBA_CACHE_DIR=str(folder))
    assert ran.returncode == 0, ran.stderr
    return folder, json.loads(ran.stdout)


def test_it_says_what_was_compiled_and_where_it_is_kept(cache):
    folder, said = cache
    assert said.keys() == {"kernels", "compiled", "seconds", "folder"}
    assert said["folder"] == str(folder)
    assert said["compiled"] >= said["kernels"] > 50
    assert said["seconds"] > 0
    compiled = [name for name in names(folder) if name.endswith(".nbc")]
    assert len(compiled) == said["compiled"]


def test_the_second_time_there_is_nothing_to_do(cache):
    folder, said = cache
    before = names(folder)
    ran = bsmap("warmup", NUMBA_CACHE_DIR=str(folder))
    assert ran.returncode == 0
    out = ran.stdout.decode()
    assert out.startswith(f"{said['kernels']} kernels, all compiled before, in ")
    assert out.endswith(f"; kept in {folder}\n")
    assert names(folder) == before


def test_quiet_is_quiet(cache):
    ran = bsmap("warmup", "-q", NUMBA_CACHE_DIR=str(cache[0]))
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, b"", b"")


RUNS = {
    "slam": ["slam", SAMPLES / "wall.mcap", "-o", "x.bsm"],
    "slam-loops": ["slam", SAMPLES / "loop.csv.gz", "-o", "x.bsm", "--levels", "all"],
    "slam-no-odometry": ["slam", SAMPLES / "spin.bag", "-o", "x.bsm", "--odom", "none"],
    "slam-paper": ["slam", "run.mcap", "-o", "x.bsm", "--profile", "paper"],
    "slam-tracked": ["slam", "run.mcap", "-o", "x.bsm", "--set", "final_map.rebuild=false"],
    "slam-degree": ["slam", "run.mcap", "-o", "x.bsm", "--set", "degree=5"],
    "slam-on": ["slam", "run.mcap", "-o", "x.bsm", "--map", "map.bsm"],
    "map": ["map", SAMPLES / "wall.mcap", "--poses", SAMPLES / "wall.truth.tum", "-o", "x.bsm"],
    "map-paper": ["map", "run.mcap", "--poses", "odom", "-o", "x.bsm", "--profile", "paper"],
    "localize": ["localize", "run.mcap", "--map", "map.bsm", "--traj", "x.tum"],
    "merge": ["merge", "map.bsm", "map.bsm", "-o", "x.bsm"],
    "sim": ["sim", "people", "--lidar", "urg04lx", "-o", "x.mcap"],
    "query": ["query", "map.bsm", "ray", "0,0,90"],
    "stats": ["stats", "map.bsm"],
    "yaml": ["export", "map.bsm", "-o", "x.yaml"],
}


@pytest.mark.parametrize("run", RUNS.values(), ids=list(RUNS))
def test_afterwards_no_run_compiles(run, cache, here):
    folder, _ = cache
    before = names(folder)
    ran = bsmap(*run, cwd=here, NUMBA_CACHE_DIR=str(folder))
    assert ran.returncode == 0, ran.stderr
    assert names(folder) == before


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path):
    (tmp_path / "file").write_text("in the way")
    ran = bsmap("warmup", NUMBA_CACHE_DIR=str(tmp_path / "file"))
    assert ran.returncode == 1
    assert message(ran).startswith("error: compiled code cannot be kept, not in ")
