"""`bsmap export`: every format by extension, options only where they mean something."""

from __future__ import annotations

import json

import pytest

from bsmap_cli.cli.formats import MAP_FORMATS
from tests.cli.tool import bsmap, message, names

STARTS = {
    "svg": b"<?xml",
    "png": b"\x89PNG",
    "geojson": b'{"type":"FeatureCollection"',
    "dxf": b"0\nSECTION\n",
    "yaml": b"image: 'x.pgm'\n",
    "csv": b"knot_step_m,",
    "json": b'{"',
    "ply": b"ply\n",
    "mcap": b"\x89MCAP0\r\n",
    "bsm": b"\x89BSM\r\n",
}


def test_every_format_is_tested():
    assert set(STARTS) == set(MAP_FORMATS.values())


@pytest.mark.parametrize("kind", sorted(STARTS))
def test_every_format_is_known_by_its_extension(kind, here):
    before = names(here)
    ran = bsmap("export", "map.bsm", "-o", f"x.{kind}", cwd=here)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout == ran.stderr == b""
    assert (here / f"x.{kind}").read_bytes().startswith(STARTS[kind])
    beside = ["x.pgm"] if kind == "yaml" else []
    assert set(names(here)) == {*before, f"x.{kind}", *beside}


@pytest.mark.parametrize("kind", ["geojson", "mcap", "bsm"])
def test_standard_output_gets_the_same_bytes(kind, here):
    bsmap("export", "map.bsm", "-o", f"x.{kind}", cwd=here)
    piped = bsmap("export", "-o", "-", "--format", kind, stdin=(here / "map.bsm").read_bytes())
    assert piped.stdout == (here / f"x.{kind}").read_bytes()


def test_the_readable_twin_comes_back_to_the_byte(here):
    bsmap("export", "map.bsm", "-o", "twin.json", cwd=here)
    bsmap("export", "twin.json", "-o", "back.bsm", cwd=here)
    assert (here / "back.bsm").read_bytes() == (here / "map.bsm").read_bytes()
    twins = [bsmap("stats", name, "--json", cwd=here).stdout for name in ("map.bsm", "twin.json")]
    assert twins[0] == twins[1]


def test_compressing_a_map_later_is_compressing_it_at_once(here):
    bsmap("export", "map.bsm", "-o", "later.bsm", "--compress", cwd=here)
    bsmap("slam", "run.mcap", "-o", "once.bsm", "--compress", cwd=here)
    assert (here / "later.bsm").read_bytes() == (here / "once.bsm").read_bytes()
    small, large = ((here / name).stat().st_size for name in ("later.bsm", "map.bsm"))
    assert small < large


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-o", "x.csv", "--origin", "1,2,3"], "goes with geojson"),
        (["-o", "x.svg", "--resolution", "0.1"], "goes with png, yaml"),
        (["-o", "x.json", "--level", "0.1"], "says nothing to json"),
        (["-o", "x.png", "--compress"], "goes with bsm"),
        (["-o", "x.mcap", "--log", "run.mcap"], "--traj"),
        (["-o", "x.mcap", "--topic", "/scan"], "--log"),
        (["-o", "x.svg", "--clip", "1,2,0,3"], "lower left"),
        (["-o", "x.svg", "--clip", "1,2,3"], "4 numbers"),
        (["-o", "x.svg", "--level", "0.7"], "knot step"),
        (["-o", "x.geojson", "--origin", "95,0,0"], "no place on Earth"),
        (["-o", "-", "--format", "yaml"], "two files"),
        (["-o", "-"], "--format"),
        (["-o", "x.obj"], ".svg"),
    ],
)
def test_what_means_nothing_is_refused(arguments, words, here):
    before = names(here)
    ran = bsmap("export", "map.bsm", *arguments, cwd=here)
    assert ran.returncode == 2
    assert words in message(ran)
    assert names(here) == before


def test_the_image_beside_a_nav2_map_is_not_replaced_unasked(here):
    (here / "x.pgm").write_text("mine")
    ran = bsmap("export", "map.bsm", "-o", "x.yaml", cwd=here)
    assert ran.returncode == 2
    assert "x.pgm exists" in message(ran)
    assert (here / "x.pgm").read_text() == "mine"
    assert not (here / "x.yaml").exists()


def test_a_clip_leaves_less(here):
    whole = bsmap("export", "map.bsm", "-o", "-", "--format", "geojson", cwd=here)
    part = bsmap(
        "export", "map.bsm", "-o", "-", "--format", "geojson", "--clip", "0,0,1,9", cwd=here
    )
    counts = [len(json.loads(ran.stdout)["features"]) for ran in (whole, part)]
    assert counts[1] < counts[0]


def test_a_clipped_map_is_a_map(here):
    ran = bsmap("export", "map.bsm", "-o", "part.bsm", "--clip", "0,0,1,9", cwd=here)
    assert ran.returncode == 0
    assert bsmap("stats", "part.bsm", cwd=here).returncode == 0
    part, whole = ((here / name).stat().st_size for name in ("part.bsm", "map.bsm"))
    assert part < whole


@pytest.mark.parametrize("out", ["x.svg", "x.bsm"])
def test_a_box_beside_the_map_is_said_to_be_empty(out, here):
    ran = bsmap("export", "map.bsm", "-o", out, "--clip", "900,900,901,901", cwd=here)
    assert ran.returncode == 0
    assert "nothing is drawn" in message(ran)
    assert (
        "nothing is drawn"
        not in bsmap("export", "map.bsm", "-o", "y.svg", cwd=here).stderr.decode()
    )


@pytest.mark.parametrize("verb", [("view", "x.html"), ("export", "x.mcap")])
def test_a_replayed_log_that_is_cut_off_is_exit_3(verb, here):
    data = (here / "run.bag").read_bytes()
    (here / "cut.bag").write_bytes(data[: len(data) // 2])
    name, output = verb
    arguments = (name, "map.bsm", "--traj", "map.tum", "--log", "cut.bag", "-o", output)
    ran = bsmap(*arguments, cwd=here)
    assert ran.returncode == 3
    assert b"missing or damaged" in ran.stderr
    assert (here / output).stat().st_size > 0


@pytest.mark.parametrize("damage", ["cut", "flipped", "text", "empty"])
def test_a_damaged_map_is_one_line(damage, here):
    data = bytearray((here / "map.bsm").read_bytes())
    if damage == "cut":
        del data[len(data) // 2 :]
    elif damage == "flipped":
        data[len(data) // 2] ^= 1
    elif damage == "text":
        data = bytearray(b"hello\n")
    else:
        data.clear()
    (here / "bad.bsm").write_bytes(data)
    for command in (["stats", "bad.bsm"], ["export", "bad.bsm", "-o", "x.svg"]):
        ran = bsmap(*command, cwd=here)
        assert ran.returncode == 1
        assert message(ran).startswith("error: bad.bsm: ")
    assert not (here / "x.svg").exists()
