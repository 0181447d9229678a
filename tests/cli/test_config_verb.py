"""`bsmap config`: what is printed, written and tested is what a run would use."""

from __future__ import annotations

import json

from bsmap_cli import __version__
from bsmap_cli.config import load_settings
from bsmap_cli.config.gathered import leaves
from tests.cli.tool import bsmap, message, names


def test_show_prints_every_setting_with_its_meaning():
    shown = bsmap("config", "show").stdout.decode()
    for key, leaf in leaves().items():
        assert f"# {leaf.meaning}" in shown
        assert f"{key.rpartition('.')[2]}: " in shown


def test_show_resolves_in_the_promised_order(tmp_path):
    (tmp_path / "robot.yaml").write_text("merging:\n  max_weight: 40\ndegree: 4\n")
    flags = ["--profile", "paper", "-c", "robot.yaml", "--set", "degree=2"]
    shown = json.loads(bsmap("config", "show", "--json", *flags, cwd=tmp_path).stdout)
    assert shown["merging"]["max_weight"] == 40
    assert shown["degree"] == 2
    assert shown["fitting"]["parameters"] == "chord"


def test_init_writes_what_check_accepts_and_a_run_reads(tmp_path):
    assert bsmap("config", "init", cwd=tmp_path).returncode == 0
    assert names(tmp_path) == ["bsmap.yaml"]
    assert load_settings(file=tmp_path / "bsmap.yaml") == load_settings()
    ran = bsmap("config", "check", "bsmap.yaml", cwd=tmp_path)
    assert (ran.returncode, ran.stdout) == (0, b"bsmap.yaml: good\n")


def test_init_keeps_the_profile_it_was_given(tmp_path):
    bsmap("config", "init", "p.yaml", "--profile", "paper", cwd=tmp_path)
    assert load_settings(file=tmp_path / "p.yaml") == load_settings("paper")


def test_init_replaces_nothing_unasked(tmp_path):
    (tmp_path / "bsmap.yaml").write_text("mine")
    ran = bsmap("config", "init", cwd=tmp_path)
    assert ran.returncode == 2
    assert "--force" in message(ran)
    assert (tmp_path / "bsmap.yaml").read_text() == "mine"
    assert bsmap("config", "init", "--force", cwd=tmp_path).returncode == 0


def test_check_names_the_line_and_the_nearest_name(tmp_path):
    (tmp_path / "robot.yaml").write_text("# mine\nsegmentation:\n  rel_gpa: 3\n")
    ran = bsmap("config", "check", "robot.yaml", cwd=tmp_path)
    assert ran.returncode == 2
    assert message(ran).startswith("error: robot.yaml:3: unknown setting 'segmentation.rel_gpa'")
    assert "did you mean 'segmentation.rel_gap'?" in message(ran)


def test_the_version_is_that_of_the_package():
    assert bsmap("--version").stdout.decode() == f"bsmap {__version__}\n"
