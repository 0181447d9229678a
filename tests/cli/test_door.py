"""Errors become one line and an exit code; nothing is left behind."""

from __future__ import annotations

import errno

import pytest

from bsmap_cli.cli.door import guarded
from bsmap_cli.cli.talk import Talk
from bsmap_cli.errors import (
    BsmapError,
    ConfigError,
    FitError,
    LogError,
    MapFileError,
    TrackingError,
    UsageError,
)
from tests.cli.tool import bsmap, message, names


def ending(error):
    def action():
        raise error

    return action


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (BsmapError("x"), 1),
        (LogError("x"), 1),
        (MapFileError("x"), 1),
        (FitError("x"), 1),
        (TrackingError("x"), 1),
        (UsageError("x"), 2),
        (ConfigError("x"), 2),
        (OSError(errno.ENOSPC, "No space left on device"), 1),
        (MemoryError(), 1),
        (ValueError("x"), 1),
        (KeyboardInterrupt(), 130),
        (SystemExit(143), 143),
        (BrokenPipeError(errno.EPIPE, "Broken pipe"), 0),
    ],
)
def test_every_error_has_its_exit_code(error, code, capsys):
    assert guarded(ending(error)) == code
    said = capsys.readouterr().err
    assert said.count("\n") <= 1
    assert "Traceback" not in said


def test_a_traceback_is_shown_with_vv_alone(capsys):
    assert guarded(ending(LogError("broken")), Talk(level=1)) == 1
    assert "Traceback" not in capsys.readouterr().err
    assert guarded(ending(LogError("broken")), Talk(level=2)) == 1
    assert "Traceback" in capsys.readouterr().err


def test_a_message_of_many_lines_is_said_on_one(capsys):
    guarded(ending(LogError("one\n  two\n")))
    assert capsys.readouterr().err == "error: one two\n"


def test_an_error_nobody_expected_asks_for_a_report(capsys):
    guarded(ending(ZeroDivisionError("division by zero")))
    assert "please report it with the output of -vv" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["simm"], "Did you mean 'sim'?"),
        (["sim"], "SCENE"),
        (["sim", "wall"], "--output"),
        (["sim", "wall", "-o", "x.mcap", "--nois", "1"], "--noise"),
        (["sim", "wall", "-o", "x.mcap", "--noise", "loud"], "--noise"),
        (["sim", "wall", "-o", "x.mcap", "--color", "red"], "auto"),
        (["sim", "wal", "-o", "x.mcap"], "wall"),
        (["sim", "wall", "-o", "x.mcap", "--lidar", "radar"], "ust10lx"),
        (["sim", "wall", "-o", "x.txt"], ".mcap, .bag, .csv"),
        (["sim", "wall", "-o", "-"], "--format"),
        (["sim", "wall", "-o", "x.mcap", "--format", "txt"], "mcap, bag, csv"),
        (["eval", "a.tum"], "--relations"),
        (["plot", "-o", "x.png"], "MAP"),
        (["config", "show", "--set", "ladder=1"], "ladder"),
        (["config", "show", "--profile", "papr"], "did you mean 'paper'?"),
        (["config", "check", "nowhere.yaml"], "nowhere.yaml"),
    ],
)
def test_usage_errors_are_one_line_and_exit_2(arguments, words, tmp_path):
    ran = bsmap(*arguments, cwd=tmp_path)
    assert ran.returncode == 2
    assert ran.stdout == b""
    assert words in message(ran)
    assert names(tmp_path) == []


def test_the_list_of_commands_says_what_each_does():
    listed = bsmap("--help", COLUMNS="80").stdout.decode().partition("Commands:")[2]
    assert listed.count("\n") > 15
    assert "..." not in listed


def test_the_parser_speaks_as_the_rest(tmp_path):
    said = message(bsmap("slam", "x.mcap", "-o", "x.bsm", "--color", "pink", cwd=tmp_path))
    assert "'pink' is not one of 'auto', 'always', 'never'" in said
    assert "Value error" not in said


def test_bsmap_alone_shows_its_help_and_exits_2():
    ran = bsmap()
    assert ran.returncode == 2
    assert ran.stdout == b""
    assert ran.stderr.startswith(b"Usage: bsmap")


def test_an_output_that_exists_is_kept(tmp_path):
    (tmp_path / "x.csv").write_text("mine")
    ran = bsmap("sim", "spin", "-o", "x.csv", cwd=tmp_path)
    assert ran.returncode == 2
    assert "--force" in message(ran)
    assert (tmp_path / "x.csv").read_text() == "mine"


def test_inputs_that_are_not_there_exit_1(tmp_path):
    for arguments in (["eval", "a.tum", "b.tum"], ["plot", "a.bsm", "-o", "x.png"]):
        ran = bsmap(*arguments, cwd=tmp_path)
        assert ran.returncode == 1
        assert "No such file" in message(ran)
    assert names(tmp_path) == []


def test_a_folder_that_is_not_there_exits_1(tmp_path):
    ran = bsmap("sim", "spin", "-o", "nowhere/x.csv", cwd=tmp_path)
    assert ran.returncode == 1
    assert "make it first" in message(ran)
