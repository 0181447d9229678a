"""`bsmap slam --map`: go on with an old map, through the installed command."""

from __future__ import annotations

import json

import numpy as np
import pytest

from bsmap_cli.exchange.tum import read_tum
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.map_file import read_map
from tests.cli.conftest import SAMPLES
from tests.cli.tool import bsmap, message, names, shell

LOG, TRUTH = SAMPLES / "twins.bag", SAMPLES / "twins.truth.tum"


def trajectory(path):
    with path.open() as lines:
        return read_tum(lines)


def document(path):
    with path.open("rb") as stream:
        return read_map(stream)


@pytest.fixture(scope="module")
def halves(tmp_path_factory):
    """first.bsm of the first 60 s, and both.bsm, which goes on with it from 50 s on."""
    folder = tmp_path_factory.mktemp("halves")
    ran = bsmap("slam", LOG, "--duration", 60, "-o", "first.bsm", "-q", cwd=folder)
    assert ran.returncode == 0, ran.stderr
    going_on = ("--map", "first.bsm", "-o", "both.bsm", "--traj", "both.tum", "--json", "-q")
    ran = bsmap("slam", LOG, "--start", 50, *going_on, cwd=folder)
    assert ran.returncode == 0, ran.stderr
    (folder / "both.json").write_bytes(ran.stdout)
    return folder


def test_the_second_half_lies_in_the_frame_of_the_first(halves):
    found, truth = trajectory(halves / "both.tum"), trajectory(TRUTH)
    origin = SE2.from_array(truth.poses[0]).inverse()
    true = np.array([(origin @ SE2.from_array(pose)).as_array() for pose in truth.poses])
    rows = np.searchsorted(truth.stamps_ns, found.stamps_ns)
    metres = np.hypot(*(found.poses - true[rows])[:, :2].T)
    assert len(found) > 150
    assert np.sqrt(np.mean(metres**2)) <= 0.05


def test_the_map_grows_and_nothing_is_drawn_twice(halves):
    report = json.loads((halves / "both.json").read_text())
    first = json.loads(bsmap("stats", "first.bsm", "--json", cwd=halves).stdout)
    assert report["map"]["length_m"] > 1.1 * first["length_m"]
    assert report["map"]["redundancy"] <= 1.10


def test_the_new_map_tells_of_both_logs_and_holds_both_paths(halves):
    first, both = document(halves / "first.bsm"), document(halves / "both.bsm")
    assert [log["name"] for log in both.meta["logs"]] == ["twins.bag", "twins.bag"]
    assert np.array_equal(both.path[: len(first.path)], first.path)
    assert len(both.path) > 1.5 * len(first.path)


def test_the_old_map_may_come_through_a_pipe(halves):
    line = f"cat first.bsm | bsmap slam {LOG} --start 50 --map - -o - -q | cmp - both.bsm"
    assert shell(line, halves).returncode == 0


def test_the_old_map_decides_the_ladder(halves, tmp_path):
    first = ("--set", "ladder=[0.4,0.2]", "-o", "coarse.bsm", "-q")
    assert bsmap("slam", LOG, "--duration", 60, *first, cwd=tmp_path).returncode == 0
    ran = bsmap(
        *("slam", LOG, "--start", 50, "--map", "coarse.bsm", "-o", "both.bsm", "-q"),
        cwd=tmp_path,
    )
    assert ran.returncode == 0, ran.stderr
    assert document(tmp_path / "both.bsm").finest.knot_step_m == 0.2


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ([SAMPLES / "shapes.mcap", "--map", "first.bsm", "-o", "x.bsm"], 1, "no place in the old"),
        ([LOG, "--map", "none.bsm", "-o", "x.bsm"], 1, "none.bsm"),
        ([LOG, "--map", "first.bsm", "-o", "first.bsm", "-f"], 2, "also an input"),
        (["-", "--map", "-", "-o", "x.bsm"], 2, "both"),
        ([LOG, "--map", "first.bsm", "--profile", "paper", "-o", "x.bsm"], 2, "final_map.rebuild"),
    ],
)
def test_what_cannot_be_is_refused_with_one_line(arguments, code, words, halves):
    before = names(halves)
    ran = bsmap("slam", *arguments, "-q", cwd=halves)
    assert ran.returncode == code
    assert words in message(ran)
    assert names(halves) == before
