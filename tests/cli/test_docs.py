"""Docs cannot lag: the page of the commands is theirs, and every command in a page runs."""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
from itertools import pairwise
from pathlib import Path

import pytest

from bsmap_cli.cli.app import VERBS
from bsmap_cli.exchange.tum import read_tum
from bsmap_cli.sensor.stamps import format_stamp
from tests.cli.conftest import SAMPLES
from tests.cli.tool import bsmap, shell

ROOT = Path(__file__).parent.parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
WRITES = {
    "slam": {"-o", "--traj"},
    "map": {"-o", "--traj"},
    "localize": {"--traj"},
    "sim": {"-o", "--truth", "--surfaces"},
}


def sections(page):
    """(heading, commands) of each part of a page that has commands to run."""
    heading, found = page.stem, []
    for part in re.split(r"^## ", page.read_text(), flags=re.MULTILINE):
        lines = [
            line
            for block in re.findall(r"```sh\n(.*?)```", part, flags=re.DOTALL)
            for line in block.splitlines()
            if line.strip()
        ]
        if lines:
            found.append((f"{heading}: {part.splitlines()[0]}", lines))
    return found


COMMANDS = [pytest.param(lines, id=name) for page in PAGES for name, lines in sections(page)]


@pytest.fixture
def place(here):
    """A folder with everything that the examples name."""
    (here / "sample_logs").symlink_to(SAMPLES)
    (here / "bag_folder").mkdir()
    shutil.copy(here / "run.mcap", here / "bag_folder")
    with (here / "truth.tum").open() as lines:
        truth = read_tum(lines)
    shutil.copy(here / "map.tum", here / "intel.tum")
    first, second = (format_stamp(int(stamp)) for stamp in truth.stamps_ns[:2])
    shutil.copy(here / "map.bsm", here / "old.bsm")
    for name in ("intel.clf.gz", "mit-csail.clf.gz"):
        shutil.copy(here / "run.mcap", here / name)  # the content says what a log is
    (here / "intel.relations").write_text(f"{first} {second} 0 0 0 0 0 0.1\n")
    assert bsmap("config", "init", "robot.yaml", cwd=here).returncode == 0
    return here


def make_room(line, folder):
    """Remove what a command is about to write: each example stands for itself."""
    for command in line.split("|"):
        words = shlex.split(command, comments=True)
        verb = words[1] if words[0] == "bsmap" else ""
        writes = WRITES.get(verb, {"-o"})
        named = [after for word, after in pairwise(words) if word in writes]
        if words[:3] == ["bsmap", "config", "init"]:
            named.append(words[3] if len(words) > 3 else "bsmap.yaml")
        for name in named:
            (folder / name).unlink(missing_ok=True)


@pytest.mark.parametrize("lines", COMMANDS)
def test_every_command_in_the_docs_runs(lines, place):
    for line in lines:
        if "pytest" in line or line.startswith(("python docs", "python benchmarks")):
            continue
        command = line.removeprefix("pip install . && ")
        assert command.startswith(("bsmap ", "cat ", "zcat ", "echo ")), line
        make_room(command, place)
        ran = shell(command, place)
        assert ran.returncode == 0, f"{command}\n{ran.stderr.decode()}"


def test_the_python_in_the_readme_runs(place):
    code = re.search(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)
    (place / "example.py").write_text(code[1])
    ran = shell("python example.py", place)
    assert ran.returncode == 0, ran.stderr.decode()
    assert re.fullmatch(r"\d+ curves, 203 poses\n", ran.stdout.decode())


def test_the_page_of_the_commands_is_theirs(rewrite_golden):
    page = runpy.run_path(str(ROOT / "docs" / "cli_page.py"))["cli_page"]()
    path = ROOT / "docs" / "cli.md"
    if rewrite_golden:
        path.write_text(page)
    assert path.read_text() == page


def test_links_between_the_pages_lead_somewhere():
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_a_help_page_with_an_example(verb):
    subcommands = {"config": ("show", "init", "check")}.get(verb, ("",))
    for subcommand in subcommands:
        ran = bsmap(verb, *filter(None, [subcommand]), "--help")
        assert ran.returncode == 0
        assert re.search(rf"Examples?:\n    .*bsmap {verb}", ran.stdout.decode())


def test_the_root_help_lists_every_verb():
    said = bsmap("--help").stdout.decode()
    listed = re.findall(r"^  (\w+)  ", said[said.index("Commands:") :], flags=re.MULTILINE)
    assert listed == list(VERBS)
