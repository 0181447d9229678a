"""`bsmap stats`: the picture of the map, where a person looks or asks for it."""

from __future__ import annotations

import re

import pytest

from tests.cli.test_terminal import ESCAPE, at_terminal
from tests.cli.tool import bsmap, message


def braille(text):
    """The lines of text that hold braille letters."""
    lines = [line.rstrip() for line in text.replace("\r\n", "\n").split("\n")]
    return [line for line in lines if re.search("[\u2801-\u28ff]", line)]


def bar(text):
    """(letters, metres) of the scale bar."""
    (found,) = re.findall("(\u251c\u2500*\u2524) ([\\d.]+) m", text)
    return len(found[0]), float(found[1])


@pytest.mark.parametrize(("columns", "lines"), [(80, 40), (200, 50), (40, 100)])
def test_a_terminal_sees_the_map_as_large_as_it_is(columns, lines, here):
    code, seen = at_terminal(
        here, "stats", "map.bsm", stdout=True, NO_COLOR="1", COLUMNS=str(columns), LINES=str(lines)
    )
    assert code == 0
    picture = braille(seen)
    assert max(map(len, picture)) < columns
    assert len(seen.splitlines()) <= lines
    full = max(map(len, picture)) == columns - 1 or len(seen.splitlines()) >= lines - 3
    assert full
    letters, metres = bar(seen)
    width = float(re.search(r"extent +([\d.]+) x", seen)[1])
    letter = metres / letters
    assert letter * max(map(len, picture)) == pytest.approx(width, rel=0.15)


def test_without_colors_there_is_the_picture_still(here):
    code, seen = at_terminal(here, "stats", "map.bsm", stdout=True, NO_COLOR="1")
    assert code == 0
    assert braille(seen)
    assert ESCAPE not in seen


@pytest.mark.parametrize("changes", [{"TERM": "dumb"}, {"TERM": "linux"}])
def test_terminals_without_such_letters_get_none(changes, here):
    code, seen = at_terminal(here, "stats", "map.bsm", stdout=True, **changes)
    assert code == 0
    assert not braille(seen)
    assert "control points" in seen


def test_it_can_be_left_out(here):
    _, seen = at_terminal(here, "stats", "map.bsm", "--no-picture", stdout=True)
    assert not braille(seen)


def test_a_pipe_gets_it_when_asked(here):
    plain = bsmap("stats", "map.bsm", cwd=here)
    asked = bsmap("stats", "map.bsm", "--picture", cwd=here)
    assert not braille(plain.stdout.decode())
    assert braille(asked.stdout.decode())
    assert asked.stdout.endswith(plain.stdout)


def test_letters_that_the_output_does_not_have(here):
    ran = bsmap("stats", "map.bsm", "--picture", cwd=here, PYTHONIOENCODING="ascii")
    assert ran.returncode == 2
    assert "leave out --picture" in message(ran)
    assert bsmap("stats", "map.bsm", cwd=here, PYTHONIOENCODING="ascii").returncode == 0


def test_no_picture_in_json(here):
    ran = bsmap("stats", "map.bsm", "--json", "--picture", cwd=here)
    assert ran.returncode == 2
    assert "--picture does not go with --json" in message(ran)


def test_a_map_that_draws_nothing(tmp_path):
    """As a log of scans without returns leaves it."""
    row = "1,0,0.01," + ",".join(["nan"] * 100)
    columns = "t,angle_min,angle_increment," + ",".join(f"r{i}" for i in range(100))
    (tmp_path / "blind.csv").write_text(f"{columns}\n{row}\n")
    made = bsmap("slam", "blind.csv", "-o", "empty.bsm", cwd=tmp_path)
    assert b"the map is empty" in made.stderr
    ran = bsmap("stats", "empty.bsm", cwd=tmp_path)
    assert ran.returncode == 0
    assert b"nothing is drawn" in ran.stdout
    assert b"too large" not in ran.stdout
