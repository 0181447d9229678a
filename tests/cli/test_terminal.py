"""What a person at a terminal sees: colors, the progress bar, no binary data."""

from __future__ import annotations

import os
import pty
import re
import select
import subprocess
import time

import pytest

from tests.cli.tool import BSMAP, bsmap, environment, shell

ESCAPE = "\x1b["


def at_terminal(folder, *arguments, stdout=False, **changes):
    """Run with standard error (and output) on a terminal; exit code and what stood there."""
    ours, theirs = pty.openpty()
    env = environment(**{"TERM": "xterm-256color", "COLUMNS": "120", **changes})
    if "NO_COLOR" not in changes:
        del env["NO_COLOR"]
    process = subprocess.Popen(
        [BSMAP, *map(str, arguments)],
        cwd=folder,
        stdin=theirs,
        stdout=theirs if stdout else subprocess.DEVNULL,
        stderr=theirs,
        env=env,
        start_new_session=True,
    )
    os.close(theirs)
    seen = b""
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline:
        if select.select([ours], [], [], 0.1)[0]:
            try:
                piece = os.read(ours, 65536)
            except OSError:  # the other side is closed
                break
            if not piece:
                break
            seen += piece
    os.close(ours)
    return process.wait(timeout=10), seen.decode()


def test_a_bar_moves_and_goes_away(here):
    code, seen = at_terminal(here, "slam", "run.mcap", "-o", "m.bsm")
    assert code == 0
    assert "scans/s" in seen and "x real time" in seen
    assert re.search(r"\n.*40 scans, [\d.]+ s, [\d.]+ x real time, 0 skipped, .*\r\n$", seen)


def test_a_dumb_terminal_gets_no_bar(here):
    code, seen = at_terminal(here, "slam", "run.mcap", "-o", "m.bsm", TERM="dumb")
    assert code == 0
    assert ESCAPE not in seen


def test_quiet_says_nothing_when_all_is_well(here):
    code, seen = at_terminal(here, "slam", "run.mcap", "-o", "m.bsm", "-q")
    assert (code, seen) == (0, "")


def test_where_nobody_looks_there_is_no_bar(here):
    ran = bsmap("slam", "run.mcap", "-o", "m.bsm", cwd=here)
    assert ESCAPE.encode() not in ran.stderr
    assert b"\r" not in ran.stderr


@pytest.mark.parametrize(
    ("arguments", "changes", "colored"),
    [
        ([], {}, True),
        ([], {"NO_COLOR": "1"}, False),
        (["--color", "never"], {}, False),
        (["--color", "always"], {"NO_COLOR": "1"}, True),
    ],
)
def test_errors_are_colored_where_that_is_wanted(arguments, changes, colored, tmp_path):
    code, seen = at_terminal(tmp_path, "stats", "absent.bsm", *arguments, **changes)
    assert code == 1
    assert (ESCAPE in seen) == colored


def test_colors_can_be_forced_into_a_pipe(here):
    assert ESCAPE.encode() not in bsmap("stats", "map.bsm", cwd=here).stdout
    forced = bsmap("stats", "map.bsm", "--color", "always", cwd=here)
    assert ESCAPE.encode() in forced.stdout


@pytest.mark.parametrize(
    "arguments",
    [
        ["slam", "run.mcap", "-o", "-"],
        ["scans", "run.mcap", "-o", "-", "--format", "mcap"],
        ["plot", "map.bsm", "-o", "-", "--format", "png"],
        ["export", "map.bsm", "-o", "-", "--format", "ply"],
        ["sim", "spin", "-o", "-", "--format", "bag"],
    ],
)
def test_binary_data_does_not_go_to_a_terminal(arguments, here):
    code, seen = at_terminal(here, *arguments, stdout=True)
    assert code == 2
    assert "binary data does not go to a terminal" in seen


def test_text_does(here):
    code, seen = at_terminal(
        here, "scans", "run.mcap", "--max-scans", "1", "-o", "-", "--format", "csv", stdout=True
    )
    assert code == 0
    assert seen.startswith("stamp_ns,")


def test_a_missing_log_at_a_terminal_is_asked_for(tmp_path):
    code, seen = at_terminal(tmp_path, "slam", "-o", "m.bsm", "--color", "never")
    assert (code, seen) == (2, "error: missing LOG: name one, or pipe it in\r\n")


def completions(words):
    """What bash would offer behind these words."""
    line = " ".join(words)
    ran = bsmap(_BSMAP_COMPLETE="complete_bash", COMP_WORDS=line, COMP_CWORD=str(len(words) - 1))
    return ran.stdout.decode().split()


def test_the_shell_completes_verbs_and_options():
    assert completions(["bsmap", "sc"]) == ["scans"]
    assert "show" in completions(["bsmap", "config", "sh"])
    assert "--laser-pose" in completions(["bsmap", "slam", "--la"])
    assert completions(["bsmap", "slam", "--color", "a"]) == ["auto", "always"]


def test_completion_works_in_a_shell_after_it_was_installed(tmp_path):
    line = (
        f"export HOME={tmp_path} SHELL=/bin/bash; bsmap --install-completion && . ~/.bashrc"
        " && COMP_WORDS=(bsmap slam --la) COMP_CWORD=2 && _bsmap_completion bsmap"
        " && echo ${COMPREPLY[@]}"
    )
    ran = shell(line, tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.decode().split()[-1] == "--laser-pose"


def test_the_completion_script_is_that_of_the_shell_in_use(tmp_path):
    ran = shell("bsmap --show-completion; true", tmp_path)
    assert b"complete -o default -F _bsmap_completion bsmap" in ran.stdout


def test_points_typed_at_a_terminal_are_answered_one_by_one(here):
    ours, theirs = pty.openpty()
    command = [BSMAP, "query", "map.bsm", "distance"]
    process = subprocess.Popen(
        command, cwd=here, stdin=theirs, stdout=theirs, stderr=theirs, env=environment()
    )
    os.close(theirs)

    def wait_for(pattern):
        seen = b""
        while not re.search(pattern, seen):
            assert select.select([ours], [], [], 60)[0], seen
            seen += os.read(ours, 65536)

    try:
        wait_for(rb"x,y a line, then Ctrl-D")
        for point in (b"1,1", b"2,1"):
            os.write(ours, point + b"\n")
            wait_for(rb"\d\.\d{6}\r\n")
        os.write(ours, b"\x04")
        assert process.wait(60) == 0
    finally:
        process.kill()
        os.close(ours)
