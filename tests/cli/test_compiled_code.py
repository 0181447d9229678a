"""Compiled code is kept where it can be, and a run works where it cannot."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import bsmap_cli
from bsmap_cli.cli.compiled_code import CACHE_VARIABLE, compiled_note, keep_compiled_code
from bsmap_cli.cli.talk import Talk

PACKAGE = Path(bsmap_cli.__file__).parent


def read_only(monkeypatch, *folders):
    """Nothing at or below these folders can be written."""
    real = os.access

    def access(path, mode, **more):
        frozen = any(Path(path).is_relative_to(folder) for folder in folders)
        return not (frozen and mode & os.W_OK) and real(path, mode, **more)

    monkeypatch.setattr(os, "access", access)


def test_nothing_changes_where_the_package_can_be_written():
    environment = {"XDG_CACHE_HOME": "/proc/nowhere"}
    keep_compiled_code(Talk(), environment)
    assert CACHE_VARIABLE not in environment


def test_what_the_user_chose_stays(monkeypatch):
    read_only(monkeypatch, "/")
    environment = {CACHE_VARIABLE: "/mine"}
    keep_compiled_code(Talk(), environment)
    assert environment == {CACHE_VARIABLE: "/mine"}


def test_the_folder_of_the_user_will_do(monkeypatch, tmp_path):
    read_only(monkeypatch, PACKAGE)
    environment = {"XDG_CACHE_HOME": str(tmp_path / "not" / "yet")}
    keep_compiled_code(Talk(), environment)
    assert CACHE_VARIABLE not in environment
    assert list(tmp_path.iterdir()) == []


def test_else_it_is_kept_for_this_run(monkeypatch, capsys):
    read_only(monkeypatch, PACKAGE, "/proc")
    environment = {"XDG_CACHE_HOME": "/proc/nowhere"}
    keep_compiled_code(Talk(level=1), environment)
    assert os.access(environment[CACHE_VARIABLE], os.W_OK)
    assert CACHE_VARIABLE in capsys.readouterr().err
    assert "to keep that" in compiled_note(9.0, environment)
    assert "later runs start at once" in compiled_note(9.0, {CACHE_VARIABLE: "/mine"})


def test_a_full_disk_is_no_place_for_it(monkeypatch):
    full = shutil.disk_usage("/")._replace(free=1 << 20)
    monkeypatch.setattr(shutil, "disk_usage", lambda folder: full)
    environment = {}
    keep_compiled_code(Talk(), environment)
    assert Path(environment[CACHE_VARIABLE]).is_dir()
