"""Ctrl-C and its kin: the right exit code, one line, nothing left behind."""

from __future__ import annotations

import gzip
import os
import signal
import subprocess
import time
from pathlib import Path

import pytest

from tests.cli.conftest import SAMPLES
from tests.cli.tool import BSMAP, environment, names


def wait_until_it_listens(process):
    """Until the command catches SIGTERM: before that, Python itself is still starting."""
    status = Path(f"/proc/{process.pid}/status")
    while status.exists() and process.poll() is None:
        caught = next(line for line in status.read_text().splitlines() if "SigCgt" in line)
        if int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.01)


def interrupted(folder, number, after_s, *arguments, stdin=subprocess.DEVNULL, **changes):
    """Send a signal to a running command; its exit code and what it said."""

    def heed_it():  # the tests may have been started so that it is ignored, as nohup does
        if number != signal.SIGKILL:
            signal.signal(number, signal.SIG_DFL)

    process = subprocess.Popen(
        [BSMAP, *map(str, arguments)],
        cwd=folder,
        stdin=stdin,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=environment(**changes),
        preexec_fn=heed_it,  # noqa: PLW1509 (no threads here)
    )
    wait_until_it_listens(process)
    time.sleep(after_s)
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert b"Traceback" not in said, said.decode()
    return process.returncode, said.decode()


@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)],
)
def test_an_interrupted_run_leaves_nothing(number, code, tmp_path):
    command = ("sim", "campus", "-o", "campus.mcap", "--truth", "campus.tum")  # takes minutes
    ended, said = interrupted(tmp_path, number, 1.0, *command)
    assert ended == code, said
    assert said == "error: interrupted\n"
    assert names(tmp_path) == []


@pytest.mark.parametrize("after_s", [0.0, 0.2, 1.0, 3.0, 5.5])
def test_ctrl_c_is_caught_from_the_start_and_in_the_compiler(after_s, tmp_path):
    cache = tmp_path / "cache"  # empty: everything is compiled anew
    folder = tmp_path / "run"
    folder.mkdir()
    command = ("slam", "-", "-q", "-o", "map.bsm")
    log = f"zcat '{SAMPLES / 'loop.csv.gz'}' && exec sleep 300"  # however fast it is, it waits
    with subprocess.Popen(
        ["sh", "-c", log], stdout=subprocess.PIPE, start_new_session=True
    ) as feed:
        ended, said = interrupted(
            folder, signal.SIGINT, after_s, *command, stdin=feed.stdout, NUMBA_CACHE_DIR=str(cache)
        )
        os.killpg(feed.pid, signal.SIGKILL)
    assert ended == 130, said
    assert said in ("", "error: interrupted\n")
    assert names(folder) == []


def test_a_killed_run_leaves_nothing_that_looks_finished(tmp_path):
    command = ("sim", "campus", "-o", "campus.mcap")
    ended, _ = interrupted(tmp_path, signal.SIGKILL, 1.0, *command)
    assert ended == -signal.SIGKILL
    assert not (tmp_path / "campus.mcap").exists()
    assert all(name.startswith(".campus.mcap.") for name in names(tmp_path))


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
def test_killed_in_the_middle_of_slam_there_is_no_map(share, tmp_path):
    (tmp_path / "old.tum").write_text("old")
    log = gzip.decompress((SAMPLES / "loop.csv.gz").read_bytes())
    command = [BSMAP, "slam", "-", "-q", "-o", "map.bsm", "--traj", "old.tum", "-f"]
    with subprocess.Popen(
        command, cwd=tmp_path, stdin=subprocess.PIPE, env=environment()
    ) as process:
        process.stdin.write(log[: int(share * len(log))])
        process.stdin.flush()  # and never closed: however fast it is, it waits for the rest
        time.sleep(1.0)
        process.kill()
    assert process.returncode == -signal.SIGKILL
    assert names(tmp_path) == ["old.tum"]
    assert (tmp_path / "old.tum").read_text() == "old"


def test_killed_while_the_files_are_written_none_appears(tmp_path):
    code = (
        "import os, signal\n"
        "from bsmap_cli.cli.outputs import Outputs\n"
        "with Outputs(force=False) as outputs:\n"
        "    outputs.add('map.bsm').open().write(b'x' * 1_000_000)\n"
        "    outputs.add('t.tum').open().write(b'y' * 1_000_000)\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    ended = subprocess.run([BSMAP.with_name("python"), "-c", code], cwd=tmp_path, check=False)
    assert ended.returncode == -signal.SIGKILL
    left = names(tmp_path)
    assert len(left) == 2
    assert all(
        name.startswith((".map.bsm.", ".t.tum.")) and name.endswith(".part") for name in left
    )
