"""Damaged inputs through the installed command: exit code, one line a loss, what is kept."""

from __future__ import annotations

import json
import os
from dataclasses import replace

import numpy as np
import pytest

from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from tests.cli.tool import bsmap, message, names
from tests.logs.making import MAKERS, SCAN, Ros, messages_of, ros_mcap, some_scans

LOG = some_scans(80, 61)
WITH_CHECKSUM = ("mcap zstd", "mcap lz4", "mcap no chunks", "mcap.gz", "csv.gz", "carmen.zst")


def scans_in(path):
    with open_log([path], ReadOptions()) as reader:
        return [scan.stamp_ns for scan in reader.scans()]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The bytes of one log of each kind."""
    folder = tmp_path_factory.mktemp("whole")
    return {kind: MAKERS[kind](folder / kind, LOG).read_bytes() for kind in (*WITH_CHECKSUM, "bag")}


def rewritten(folder, data, *flags):
    """`bsmap scans` of a log: the command, and the stamps of the scans it wrote."""
    (folder / "log").write_bytes(data)
    ran = bsmap("scans", "log", "-o", "out.csv", "--force", *flags, cwd=folder)
    wrote = scans_in(folder / "out.csv") if (folder / "out.csv").exists() else None
    return ran, wrote


@pytest.mark.parametrize("kind", WITH_CHECKSUM)
@pytest.mark.parametrize("how", ["cut", "flip"])
def test_damage_that_a_checksum_tells_is_exit_3(how, kind, whole, tmp_path):
    data = bytearray(whole[kind])
    middle = len(data) // 2
    if how == "cut":
        del data[middle:]
    else:
        data[middle] ^= 0x55
    ran, wrote = rewritten(tmp_path, data)
    if kind.endswith("zst"):  # its one block is all or nothing
        assert ran.returncode in (1, 3)
        return
    assert ran.returncode == 3, ran.stderr
    assert "damaged" in ran.stderr.decode()
    assert 10 < len(wrote) < len(LOG) + (kind == "mcap no chunks")
    assert set(wrote) <= {scan.stamp_ns for scan in LOG}


def test_a_cut_bag_is_exit_3(whole, tmp_path):
    ran, wrote = rewritten(tmp_path, whole["bag"][: len(whole["bag"]) // 2])
    assert ran.returncode == 3
    assert wrote == [scan.stamp_ns for scan in LOG[: len(wrote)]]


@pytest.mark.parametrize("kind", ["mcap zstd", "mcap json", "bag bz2", "carmen robotlaser", "csv"])
def test_bad_scans_are_exit_3_with_their_number(kind, tmp_path):
    bad = replace(LOG[7], ranges_m=LOG[7].ranges_m[:1])
    MAKERS[kind](tmp_path / "log", [*LOG[:7], bad, *LOG[8:]])
    ran = bsmap("scans", "log", "-o", "out.csv", cwd=tmp_path)
    assert ran.returncode == 3
    assert "1 scan could not be read" in ran.stderr.decode()
    assert scans_in(tmp_path / "out.csv") == [s.stamp_ns for s in LOG if s is not LOG[7]]


def test_strict_turns_a_loss_into_a_failure_without_a_file(whole, tmp_path):
    ran, wrote = rewritten(tmp_path, whole["mcap zstd"][:-9000], "--strict")
    assert (ran.returncode, wrote) == (1, None)
    assert names(tmp_path) == ["log"]


@pytest.mark.parametrize("verb", [["slam", "-o", "m.bsm"], ["scans", "-o", "out.mcap"], ["check"]])
def test_a_log_of_which_no_scan_can_be_read(verb, tmp_path):
    ros = Ros()
    log = ros_mcap(messages_of(LOG, ros), ros, schemas={SCAN: b"string ranges"})
    (tmp_path / "log").write_bytes(log)
    ran = bsmap(verb[0], "log", *verb[1:], cwd=tmp_path)
    assert ran.returncode == 1
    assert message(ran).startswith("error: none of the scans of log can be read (80 tried)")
    assert names(tmp_path) == ["log"]


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5, 0.7, 0.9])
@pytest.mark.parametrize("how", ["cut", "flip"])
def test_a_damaged_map_is_refused_with_its_place(how, share, here):
    data = bytearray((here / "map.bsm").read_bytes())
    at = int(share * len(data))
    if how == "cut":
        del data[at:]
    else:
        data[at] ^= 0x10
    (here / "bad.bsm").write_bytes(data)
    ran = bsmap("stats", "bad.bsm", cwd=here)
    assert ran.returncode == 1
    assert message(ran).startswith("error: bad.bsm: ")
    assert "byte" in message(ran)


def test_a_log_without_a_return_gives_an_empty_map_and_says_so(tmp_path):
    blind = [replace(scan, ranges_m=np.full_like(scan.ranges_m, np.nan)) for scan in LOG]
    MAKERS["mcap zstd"](tmp_path / "log", blind)
    ran = bsmap("slam", "log", "-o", "m.bsm", "-q", cwd=tmp_path)
    assert ran.returncode == 0
    assert message(ran).startswith("warning: the map is empty")
    assert b"\n0.1 m      0 " in bsmap("stats", "m.bsm", cwd=tmp_path).stdout


def test_a_log_whose_name_is_no_text(here):
    name = b"\xff\xfe.mcap"
    (here / "run.mcap").rename(os.fsdecode(os.fsencode(here) + b"/" + name))
    ran = bsmap("slam", os.fsdecode(name), "-o", "m.bsm", "-q", cwd=here)
    assert (ran.returncode, ran.stderr) == (0, b"")
    assert bsmap("stats", "m.bsm", cwd=here).returncode == 0


@pytest.mark.parametrize("flag", ["--start", "--end", "--duration", "--angle-min"])
@pytest.mark.parametrize("number", ["inf", "1e400", "nan"])
def test_numbers_that_are_none(flag, number, here):
    ran = bsmap("scans", "run.mcap", "-o", "x.csv", flag, number, cwd=here)
    assert ran.returncode == 2
    assert flag in message(ran)


def test_a_disk_that_fails_to_read():
    """Nothing can be read at the start of this file, as of a bad sector."""
    ran = bsmap("info", "/proc/self/mem")
    assert ran.returncode == 1
    assert message(ran) == "error: mem: reading fails (Input/output error)"


def test_names_of_any_letters_keep_the_table_straight(tmp_path):
    ros = Ros()
    names_ = ("/a\nb\tc", "/レーザー", "/скан", "/e\u0301cho")
    messages = [(name, SCAN, LOG[0].stamp_ns, ros.scan(LOG[0])) for name in names_]
    (tmp_path / "log").write_bytes(ros_mcap(messages, ros))
    lines = bsmap("info", "log", cwd=tmp_path).stdout.decode().splitlines()
    rows = [line.partition("sensor_msgs")[0] for line in lines if "sensor_msgs" in line]
    assert sorted(row.strip() for row in rows) == sorted([r"/a\nb\tc", *names_[1:]])
    extra = {names_[1]: 4, names_[3]: -1}  # columns beyond one a letter
    assert len({len(row) + extra.get(row.strip(), 0) for row in rows}) == 1


def test_a_log_that_is_cut_off_is_exit_3_for_info_too(whole, tmp_path):
    (tmp_path / "log").write_bytes(whole["bag"][: len(whole["bag"]) // 2])
    ran = bsmap("info", "log", "--json", cwd=tmp_path)
    assert ran.returncode == 3
    assert json.loads(ran.stdout)["selected"] == ["/scan"]
    assert b"missing or damaged" in ran.stderr


def test_names_out_of_a_file_do_not_steer_the_terminal(tmp_path):
    ros = Ros()
    topic = "/scan\x1b[2J\x1b]0;title\x07"
    messages = [(topic, SCAN, scan.stamp_ns, ros.scan(scan, frame="a\x1bb")) for scan in LOG]
    (tmp_path / "log").write_bytes(ros_mcap(messages, ros))
    for verb in ("info", "check"):
        ran = bsmap(verb, "log", cwd=tmp_path)
        assert ran.returncode == 0
        said = ran.stdout + ran.stderr
        assert b"\x1b" not in said and b"\x07" not in said
        assert rb"\x1b" in said


@pytest.mark.parametrize("kind", ["csv", "mcap"])
def test_check_tells_once_that_the_laser_has_no_place(kind, tmp_path):
    ros = Ros()
    messages = [("/scan", SCAN, scan.stamp_ns, ros.scan(scan, frame="eye")) for scan in LOG]
    rows = ["t,angle_min,angle_increment,r0,r1\n", *(f"{k},0,0.1,1,2\n" for k in range(9))]
    log = "".join(rows).encode() if kind == "csv" else ros_mcap(messages, ros)
    (tmp_path / "log").write_bytes(log)
    ran = bsmap("check", "log", cwd=tmp_path)
    assert ran.returncode == 0
    assert (ran.stdout + ran.stderr).count(b"--laser-pose") == 1
    assert ran.stdout.count(b"is taken to be the base") == 1
    assert kind == "csv" or b"'eye'" in ran.stdout
