"""`bsmap diff` and `bsmap merge` through the installed command."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from bsmap_cli.evaluation.pose_arrays import transform_poses
from bsmap_cli.evaluation.redundancy import redundancy
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.map_file import read_map, write_map
from bsmap_cli.mapping.mapper import Mapper
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.queries import MapQuery
from bsmap_cli.mapping.sampling import sample_level
from bsmap_cli.sensor.simulator.simulation import simulate
from tests.cli.conftest import SAMPLES
from tests.cli.tool import bsmap, message, names, shell
from tests.maps import room_document

KEYS = ["added_m", "removed_m", "unseen_m", "common_m", "rms_m", "segments", "at", "tolerance_m"]
POSE = SE2(7.0, -3.0, 2.0)


def save(path, document):
    with path.open("wb") as stream:
        write_map(stream, document)


def load(path):
    with path.open("rb") as stream:
        return read_map(stream)


def moved(document, pose):
    levels = tuple(level.moved(pose) for level in document.levels)
    path = transform_poses(pose, document.path.astype(float)).astype(np.float32)
    return replace(document, levels=levels, path=path)


def mapped(sim, first=0, end=None, ladder=(0.4, 0.2, 0.1)):
    """The finest level of a map in the world frame, from true poses."""
    mapper = Mapper(MappingSettings(ladder=ladder))
    for scan, pose in list(zip(sim.scans(), sim.truth.poses, strict=True))[first:end]:
        mapper.insert(scan, SE2.from_array(pose))
    document = mapper.document()
    path = sim.truth.poses[first:end][::5].astype(np.float32)
    return replace(document, levels=document.levels[-1:], path=path)


@pytest.fixture(scope="module")
def ring():
    """A run once round a ring of corridors, with odometry that does not matter."""
    return simulate("loop", seed=1, rate_hz=2.5, noise_m=0.01)


@pytest.fixture(scope="module")
def maps(tmp_path_factory, ring):
    """room.bsm, moved.bsm; before.bsm, after.bsm of a room where boxes moved; halves of a ring."""
    folder = tmp_path_factory.mktemp("maps")
    save(folder / "room.bsm", room_document())
    save(folder / "moved.bsm", moved(room_document(), POSE.inverse()))
    changes = simulate("changes", seed=1, rate_hz=4.0)
    half = len(changes) // 2
    save(folder / "before.bsm", mapped(changes, 0, half - 1))
    save(folder / "after.bsm", moved(mapped(changes, half + 5), POSE.inverse()))
    third = 3 * len(ring) // 8
    save(folder / "one.bsm", mapped(ring, 0, third))
    other = mapped(ring, third - 60, 5 * len(ring) // 8)
    save(folder / "two.bsm", moved(other, POSE.inverse()))
    save(folder / "whole.bsm", mapped(ring, 0, 5 * len(ring) // 8))
    return folder


def difference(*arguments, cwd):
    ran = bsmap("diff", *arguments, "--json", "-q", cwd=cwd)
    assert ran.returncode == 0, ran.stderr
    report = json.loads(ran.stdout)
    assert list(report) == KEYS
    return report


def assert_at(report, pose, metres=1e-3):
    x, y, yaw_deg = report["at"]
    assert math.hypot(x - pose.x, y - pose.y) < metres
    assert abs(math.remainder(math.radians(yaw_deg) - pose.theta, math.tau)) < 1e-3


def test_a_map_does_not_differ_from_itself(maps):
    report = difference("room.bsm", "room.bsm", cwd=maps)
    assert (report["added_m"], report["removed_m"], report["segments"]) == (0, 0, [])
    assert report["rms_m"] < 1e-5


@pytest.mark.parametrize("at", [(), ("--at", "6.2,-2.4,100")])
def test_a_map_that_was_moved_is_found_and_does_not_differ(at, maps):
    report = difference("room.bsm", "moved.bsm", *at, cwd=maps)
    assert_at(report, POSE)
    assert (report["added_m"], report["removed_m"]) == (0, 0)


def test_boxes_that_were_moved_are_what_changed(maps):
    report = difference("before.bsm", "after.bsm", cwd=maps)
    assert_at(report, POSE, 0.02)
    gone, came = SE2(5.6, 5.5, 0.1), SE2(0.6, 3.0, 0.3)
    for change, box, reach in (("removed", gone, 0.75), ("added", came, 0.6)):
        longest = next(part for part in report["segments"] if part["change"] == change)
        seen = box.inverse().transform(np.array(longest["points"]))
        assert np.abs(seen).max() < reach
        assert longest["length_m"] > 1.0
        others = [part for part in report["segments"] if part["change"] == change][1:]
        assert sum(part["length_m"] for part in others) < 1.0  # what the boxes hid
    assert report["rms_m"] < 0.02


def test_a_person_reads_what_changed(maps):
    ran = bsmap("diff", "before.bsm", "after.bsm", cwd=maps)
    assert ran.returncode == 0
    lines = ran.stdout.decode().splitlines()
    heads = ["B", "common", "added", "removed", "unseen", "change"]
    assert [line.split()[0] for line in lines[:6]] == heads
    assert "B lies in A at" in message(ran)


def test_a_map_without_a_path_is_said_to_tell_nothing(maps, tmp_path):
    save(tmp_path / "bare.bsm", replace(load(maps / "after.bsm"), path=np.zeros((0, 3), "f4")))
    ran = bsmap("diff", "before.bsm", tmp_path / "bare.bsm", "--json", cwd=maps)
    assert b"B has no path" in ran.stderr
    report = json.loads(ran.stdout)
    assert report["removed_m"] == 0.0
    assert report["unseen_m"] > 1.0


def test_two_halves_of_a_ring_make_the_whole(maps, ring):
    ran = bsmap("merge", "one.bsm", "two.bsm", "-o", "-", "-q", cwd=maps)
    assert ran.returncode == 0, ran.stderr
    (maps / "both.bsm").write_bytes(ran.stdout)
    both, whole = load(maps / "both.bsm"), load(maps / "whole.bsm")
    assert redundancy(both.finest) <= 1.10
    far = MapQuery(whole.finest).nearest(sample_level(both.finest, 0.05).points).distance_m
    assert np.percentile(far, 99) <= 0.02
    report = difference("whole.bsm", "both.bsm", cwd=maps)
    assert report["removed_m"] + report["added_m"] < 0.01 * report["common_m"]


def test_the_order_does_not_matter_but_for_the_frame(maps):
    for a, b, name in (("one.bsm", "two.bsm", "forth.bsm"), ("two.bsm", "one.bsm", "back.bsm")):
        assert bsmap("merge", a, b, "-o", name, "-f", "-q", cwd=maps).returncode == 0
    report = difference("forth.bsm", "back.bsm", cwd=maps)
    assert_at(report, POSE, 0.02)
    assert report["removed_m"] + report["added_m"] < 0.01 * report["common_m"]
    assert report["rms_m"] < 0.01


def test_a_map_merged_with_itself_is_itself(maps):
    assert bsmap("merge", "one.bsm", "one.bsm", "-o", "twice.bsm", "-q", cwd=maps).returncode == 0
    one, twice = load(maps / "one.bsm").finest, load(maps / "twice.bsm").finest
    assert len(twice.weights) == pytest.approx(len(one.weights), rel=0.01)
    assert twice.weights.astype(int).sum() > one.weights.astype(int).sum()
    report = difference("one.bsm", "twice.bsm", cwd=maps)
    assert (report["added_m"], report["removed_m"]) == (0, 0)
    assert report["rms_m"] < 0.002


def test_path_description_and_frame(maps):
    assert bsmap("merge", "room.bsm", "moved.bsm", "-o", "m.bsm", "-q", cwd=maps).returncode == 0
    room, other, both = (load(maps / name) for name in ("room.bsm", "moved.bsm", "m.bsm"))
    assert np.array_equal(both.path[:3], room.path)
    expected = [(POSE @ SE2.from_array(pose)).as_array() for pose in other.path]
    assert both.path[3:, :2] == pytest.approx(np.array(expected)[:, :2], abs=1e-3)
    assert both.meta["frame"] == "map"
    assert both.finest.knot_step_m == 0.1


@pytest.mark.parametrize(("step", "degree"), [(0.2, 3), (0.05, 3), (0.1, 4)])
def test_maps_of_other_knot_steps_and_degrees_are_brought_onto_those_of_the_first(
    step, degree, maps, tmp_path
):
    other = room_document(step)
    if degree != 3:
        level = other.finest
        tau = level.tau_start_m + np.float32(step)
        other = replace(
            other, degree=degree, levels=(replace(level, degree=degree, tau_start_m=tau),)
        )
    save(tmp_path / "other.bsm", other)
    ran = bsmap("merge", maps / "room.bsm", "other.bsm", "-o", "m.bsm", "-q", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    both = load(tmp_path / "m.bsm")
    assert (both.finest.knot_step_m, both.degree) == (0.1, 3)
    assert redundancy(both.finest) <= 1.10
    assert difference(maps / "room.bsm", "m.bsm", cwd=tmp_path)["added_m"] == 0


def test_maps_without_overlap_are_joined_where_the_user_says(maps, tmp_path):
    far = ("--at", "100,0,0", "-o", "m.bsm")
    ran = bsmap("merge", maps / "room.bsm", maps / "room.bsm", *far, "-q", cwd=tmp_path)
    assert ran.returncode == 0
    assert "as it was given" in message(ran)
    both, room = load(tmp_path / "m.bsm").finest, room_document().finest
    assert len(both) == 2 * len(room)
    assert both.control_points[:, 0].max() == pytest.approx(106.0, abs=0.01)


def test_maps_go_through_pipes(maps):
    line = (
        "cat moved.bsm | bsmap merge room.bsm - -o - -q | bsmap diff - room.bsm --json -q"
        " | grep -c '\"removed_m\": 0.0'"
    )
    assert shell(line, maps).stdout == b"1\n"


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["diff", "room.bsm", "before.bsm"], 1, "--at"),
        (["merge", "room.bsm", "before.bsm", "-o", "x.bsm"], 1, "--at"),
        (["merge", "room.bsm", "moved.bsm", "-o", "room.bsm", "-f"], 2, "also an input"),
        (["merge", "room.bsm", "moved.bsm"], 2, "--output"),
        (["merge", "room.bsm", "moved.bsm", "--at", "1,2", "-o", "x.bsm"], 2, "--at 1,2"),
        (["diff", "room.bsm", "none.bsm"], 1, "none.bsm"),
        (["diff", "-", "-"], 2, "standard input"),
        (["diff", "room.bsm", "moved.bsm", "--tolerance", "0"], 2, "--tolerance"),
        (["diff", "room.bsm", SAMPLES / "wall.mcap"], 1, "wall.mcap"),
    ],
)
def test_what_cannot_be_is_refused_with_one_line(arguments, code, words, maps):
    before = names(maps)
    ran = bsmap(*arguments, "-q", cwd=maps)
    assert ran.returncode == code
    assert words in message(ran)
    assert names(maps) == before
