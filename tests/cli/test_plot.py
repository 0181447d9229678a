"""`bsmap plot`: what the picture shows is asked for by options that mean something."""

from __future__ import annotations

import pytest

from tests.cli.tool import bsmap, message, names

LOOKS = {
    "plain": [],
    "traj": ["--traj", "map.tum"],
    "curve": ["--color-by", "curve"],
    "level": ["--color-by", "level", "--dark"],
    "marks": ["--control-points", "--knots", "--clip", "0,0,2,2"],
    "reference": ["--traj", "map.tum", "--reference", "truth.tum"],
    "overlay": ["--overlay", "other.bsm"],
    "dark": ["--dark"],
}
STARTS = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}


@pytest.mark.parametrize("look", LOOKS.values(), ids=list(LOOKS))
def test_looks_differ(look, here):
    bsmap("map", "run.mcap", "--poses", "truth.tum", "-o", "other.bsm", "--max-scans=9", cwd=here)
    ran = bsmap("plot", "map.bsm", "-o", "x.png", *look, cwd=here)
    assert (ran.returncode, ran.stdout, ran.stderr) == (0, b"", b"")
    plain = bsmap("plot", "map.bsm", "-o", "-", "--format", "png", cwd=here)
    assert plain.stdout.startswith(STARTS["png"])
    assert ((here / "x.png").read_bytes() == plain.stdout) == (not look)


@pytest.mark.parametrize("kind", sorted(STARTS))
def test_the_format_is_that_of_the_name(kind, here):
    assert bsmap("plot", "map.bsm", "-o", f"x.{kind}", cwd=here).returncode == 0
    assert (here / f"x.{kind}").read_bytes().startswith(STARTS[kind])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--reference", "truth.tum"], "--traj"),
        (["--overlay", "map.bsm", "--color-by", "curve"], "--color-by says nothing"),
        (["--clip", "1,2,0,3"], "lower left"),
        (["--format", "svg", "--width", "700"], "--width says nothing to svg"),
        (["--color-by", "age"], "--color-by"),
        (["--level", "0.7"], "knot step"),
    ],
)
def test_what_means_nothing_is_refused(arguments, words, here):
    before = names(here)
    ran = bsmap("plot", "map.bsm", "-o", "x.png", *arguments, cwd=here)
    assert ran.returncode == 2
    assert words in message(ran)
    assert names(here) == before
