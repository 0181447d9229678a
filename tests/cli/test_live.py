"""`bsmap slam --live`: the map is the same, and whatever is missing is one line."""

from __future__ import annotations

import signal
import socket
import subprocess

import pytest

from tests.cli.tool import BSMAP, bsmap, environment, message, names
from tests.exchange.foxglove_client import Viewer


def free_port():
    with socket.socket() as any_port:
        any_port.bind(("127.0.0.1", 0))
        return any_port.getsockname()[1]


def test_a_watched_run_writes_the_same_bytes(here):
    port = free_port()
    viewer = Viewer(port)
    ran = bsmap(
        *("slam", "run.mcap", "-o", "live.bsm", "--traj", "live.tum"),
        *("--live", "--live-port", port),
        cwd=here,
    )
    assert ran.returncode == 0
    said = ran.stderr.decode()
    assert f"live view: open ws://127.0.0.1:{port} in Foxglove\n" in said
    assert "nobody" not in said
    viewer.end()
    assert viewer.of("/scan")
    assert viewer.of("/map/curves")[-1].deletions
    for name in ("bsm", "tum"):
        assert (here / f"live.{name}").read_bytes() == (here / f"map.{name}").read_bytes()


def test_where_nobody_looks_the_run_goes_on(here):
    ran = bsmap(
        *("slam", "run.mcap", "-o", "live.bsm"),
        *("--live", "--live-port", "0", "--live-wait", "4"),
        cwd=here,
    )
    assert ran.returncode == 0
    assert b"nobody looks yet" in ran.stderr
    assert b"compiled" not in ran.stderr  # waiting is not compiling
    assert (here / "live.bsm").read_bytes() == (here / "map.bsm").read_bytes()


def test_a_port_in_use_is_one_line(here):
    before = names(here)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        ran = bsmap("slam", "run.mcap", "-o", "x.bsm", "--live", "--live-port", port, cwd=here)
    assert ran.returncode == 1
    assert f"nothing can be served on port {port}" in message(ran)
    assert names(here) == before


def test_a_missing_extra_is_one_line(here, tmp_path_factory):
    """A package of that name that cannot be imported stands for none."""
    folder = tmp_path_factory.mktemp("without")
    (folder / "foxglove.py").write_text("raise ModuleNotFoundError('No module named foxglove')")
    before = names(here)
    ran = bsmap("slam", "run.mcap", "-o", "x.bsm", "--live", cwd=here, PYTHONPATH=str(folder))
    assert ran.returncode == 1
    assert message(ran) == "error: the live view needs its extra: pip install 'bsmap[live]'"
    assert names(here) == before


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--live-port", "8765"], "add --live"),
        (["--live-wait", "1"], "add --live"),
        (["--live", "--live-port", "70000"], "--live-port"),
    ],
)
def test_what_means_nothing_is_refused(arguments, words, here):
    ran = bsmap("slam", "run.mcap", "-o", "x.bsm", *arguments, cwd=here)
    assert ran.returncode == 2
    assert words in message(ran)


def test_ctrl_c_ends_the_wait_and_leaves_nothing(here):
    before = names(here)
    process = subprocess.Popen(
        [BSMAP, "slam", "run.mcap", "-o", "x.bsm", "--live", "--live-port=0", "--live-wait=60"],
        cwd=here,
        stderr=subprocess.PIPE,
        env=environment(),
    )
    assert b"live view: open" in process.stderr.readline()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=30)
    assert (process.returncode, said) == (130, b"error: interrupted\n")
    assert names(here) == before
