"""`bsmap query`: points from arguments or CSV, answers as CSV or JSON."""

from __future__ import annotations

import json

import pytest

from tests.cli.tool import bsmap, message, shell


@pytest.fixture
def room(made):
    return made / "map.bsm"


def rows(ran):
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.decode().splitlines()


def test_points_may_begin_with_a_minus(room):
    answers = rows(bsmap("query", room, "nearest", "-1.5,-0.25", "-1,2"))
    assert answers[0] == "x_m,y_m,distance_m,side,heading_deg,curve_id,tau_m"
    assert len(answers) == 3


def test_arguments_and_rows_get_the_same_answers(room):
    points = ["0.5,0.25", "-1,2", "1,1"]
    by_argument = rows(bsmap("query", room, "distance", *points))
    plain = rows(bsmap("query", room, "distance", stdin="\n".join(points).encode()))
    swapped = ["y, x", *(",".join(reversed(point.split(","))) for point in points)]
    named = rows(bsmap("query", room, "distance", stdin="\n".join(swapped).encode()))
    assert by_argument == plain == named


def test_json_holds_the_same_as_csv(room):
    header, answer = rows(bsmap("query", room, "nearest", "0,0"))
    (found,) = json.loads(bsmap("query", room, "nearest", "0,0", "--json").stdout)
    assert list(found) == header.split(",")
    for name, cell in zip(header.split(","), answer.split(","), strict=True):
        shown = f"{found[name]:.6f}" if isinstance(found[name], float) else str(found[name])
        assert shown == cell


def test_a_ray_ends_on_the_nearest_point(room):
    hit = json.loads(bsmap("query", room, "ray", "0,0,0", "--json").stdout)[0]
    assert hit["x_m"] == pytest.approx(hit["range_m"])
    assert abs(hit["y_m"]) < 1e-9
    point = f"{hit['x_m']},{hit['y_m']}"
    near = json.loads(bsmap("query", room, "nearest", point, "--json").stdout)[0]
    assert near["distance_m"] < 1e-3
    assert near["curve_id"] == hit["curve_id"]


def test_a_ray_that_meets_nothing_has_an_empty_range(room):
    assert rows(bsmap("query", room, "ray", "0,0,0", "--range-max", "0.1"))[1] == ",,,"


def test_answers_stream_through_a_pipe(room, tmp_path):
    line = f"yes 1,1 | head -50000 | bsmap query {room} distance | head -2"
    ran = shell(line, tmp_path)
    assert ran.returncode in (0, 141)  # `yes` is stopped by the closed pipe
    assert ran.stdout.splitlines()[0] == b"distance_m"


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["nearest", "1"], 2, "'1' is no point"),
        (["nearest", "1,x"], 2, "'1,x' is no point"),
        (["nearest", "1,nan"], 2, "no point"),
        (["ray", "1,2"], 2, "x,y,angle_deg"),
        (["nearest", "--jsn", "1,2"], 2, "'--jsn' is no point"),
        (["closest", "1,2"], 2, "nearest"),
        (["nearest", "1,2", "--level", "0.7"], 2, "knot step"),
    ],
)
def test_bad_questions_are_one_line(arguments, code, words, room):
    ran = bsmap("query", room, *arguments)
    assert ran.returncode == code
    assert words in message(ran)


def test_a_bad_row_is_named(room):
    ran = bsmap("query", room, "distance", stdin=b"x,y\n1,2\n3,?\n")
    assert ran.returncode == 1
    assert "'3,?' is no point" in message(ran)
    ran = bsmap("query", room, "ray", stdin=b"x,y\n1,2\n")
    assert "no column angle_deg" in message(ran)
