"""CARMEN and CSV in their variants."""

import dataclasses
import math
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsmap_cli.errors import BsmapError, LogError, UsageError
from bsmap_cli.exchange.log_writers import write_log
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.messages import BadMessageError
from bsmap_cli.logs.text_log import stamp_ns_of
from tests.logs.making import (
    assert_same,
    carmen,
    csv,
    flaser,
    float32,
    odom,
    rawlaser,
    read,
    robotlaser,
    seconds,
    some_scans,
)

SCANS = some_scans(120, 31)
WIDE = some_scans(120)


def written(tmp_path, data):
    path = tmp_path / "log"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


@given(st.decimals(-(10**9), 10**10 - 1, places=9, allow_nan=False))
def test_stamps_are_exact(value):
    assert stamp_ns_of(str(value).encode()) == int(value * 10**9)


@pytest.mark.parametrize(
    ("text", "ns"),
    [
        ("976052857.337530", 976052857337530000),
        ("0", 0),
        ("1.5e9", 1500000000000000000),
        ("1.2345678905", 1234567890),
        ("1.2345678906", 1234567891),
        (".5", 500000000),
    ],
)
def test_stamps_as_they_occur(text, ns):
    assert stamp_ns_of(text.encode()) == ns


@pytest.mark.parametrize("text", ["", "nan", "inf", "1e999999999", "x", "1.2.3", "1,5", "é", "--1"])
def test_what_is_no_stamp(text):
    with pytest.raises(BadMessageError):
        stamp_ns_of(text.encode())


# --- CARMEN -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("beams", "low_deg", "step_deg"),
    [(180, -90, 1), (181, -90, 1), (360, -90, 0.5), (361, -90, 0.5)],
)
def test_angles_by_the_number_of_beams(tmp_path, beams, low_deg, step_deg):
    scans = some_scans(3, beams)
    found, report = read(written(tmp_path, carmen(scans)))
    assert found[0].angle_min_rad == float32(math.radians(low_deg))
    assert found[0].angle_increment_rad == float32(math.radians(step_deg))
    assert report.warnings == []


def test_other_numbers_of_beams_are_told(tmp_path):
    path = written(tmp_path, carmen(some_scans(3, 541)))
    (scan, *_), report = read(path)
    assert scan.angle_min_rad == float32(math.radians(-135))
    assert scan.angle_increment_rad == float32(math.radians(0.5))
    assert "270 degrees" in report.warnings[0]
    assert "--angle-min" in report.warnings[0]
    angles = {"angle_min_rad": -2.356, "angle_increment_rad": 0.0087}
    (scan, *_), report = read(path, **angles)
    assert (scan.angle_min_rad, scan.angle_increment_rad) == (float32(-2.356), float32(0.0087))
    assert report.warnings == []


def test_robotlaser_states_its_angles_and_its_limit(tmp_path):
    lines = carmen(SCANS, lambda scan: robotlaser(scan, remissions=(1, 2, 3), farthest=81.9))
    found, _ = read(written(tmp_path, lines))
    assert_same(found, [dataclasses.replace(scan, range_max_m=float32(81.9)) for scan in SCANS])


@pytest.mark.parametrize("line", [flaser, robotlaser])
@pytest.mark.parametrize("place", [SE2(0.04, 0.0, 0.0), SE2(-0.1, 0.25, 3.0)])
def test_the_lasers_place_where_the_lines_agree(tmp_path, line, place):
    found, report = read(written(tmp_path, carmen(WIDE, lambda scan: line(scan, place))))
    laser = found[0].pose_base_laser
    np.testing.assert_allclose(laser.as_array(), place.as_array(), atol=2e-5)
    assert all(scan.pose_base_laser == laser for scan in found)
    assert report.warnings == []


def test_raw_lines_take_poses_between_odometry_lines(tmp_path):
    scans = WIDE[:3]
    start = scans[0].stamp_ns
    step = 100_000_000
    scans = [dataclasses.replace(s, stamp_ns=start + i * step) for i, s in enumerate(scans)]
    before, after = SE2(1.0, 2.0, 0.5), SE2(3.0, 2.0, 0.7)
    lines = [
        "PARAM robot_frontlaser_offset 0.04 1.5 host 0.5\n",
        odom(start - step, before),
        *map(rawlaser, scans),
        "ODOM what\n",
        odom(start + 3 * step, after),
    ]
    found, report = read(written(tmp_path, "".join(lines).encode()))
    assert [scan.pose_odom_base.x for scan in found] == pytest.approx([1.5, 2.0, 2.5])
    assert [scan.pose_odom_base.theta for scan in found] == pytest.approx([0.55, 0.6, 0.65])
    assert {scan.pose_base_laser for scan in found} == {SE2(0.04, 0.0, 0.0)}
    assert (report.warnings, report.odometry) == ([], "poses in the log")


def test_raw_lines_without_odometry_or_place(tmp_path):
    path = written(tmp_path, b"".join(rawlaser(scan).encode() for scan in SCANS))
    found, report = read(path)
    assert_same(found, SCANS, odometry=False)
    assert report.odometry == "none"
    assert report.places_unknown


def test_raw_lines_are_the_same_scans_once_more(tmp_path):
    lines = carmen(SCANS, lambda scan: rawlaser(scan) + robotlaser(scan))
    path = written(tmp_path, lines)
    assert_same(read(path)[0], SCANS)
    raw, _ = read(path, topics=("RAWLASER1",))
    assert [scan.stamp_ns for scan in raw] == [scan.stamp_ns for scan in SCANS]
    assert {scan.topic for scan in raw} == {"RAWLASER1"}


def test_a_robot_that_drives_before_its_laser_runs(tmp_path):
    many = b"ODOM 1 2 3 0 0 0 1300000000.5 host 0.1\n" * 60_000
    found, _ = read(written(tmp_path, many + carmen(SCANS)))
    assert_same(found, SCANS)


def test_a_log_of_bad_lines_alone(tmp_path):
    with pytest.raises(LogError, match="no scan that can be read, the first because: line 1 of"):
        read(written(tmp_path, b"FLASER 9 1 2 3\n" * 30_000))


@pytest.mark.parametrize("more", ["", " behind the stamp"])
@pytest.mark.parametrize(
    "numbers", ["1 2.5 3 4 0 3 4 0", "1. 2.5  3.0 +4 0 3\t4 0.", "1e0 25e-1 3 4 0 3 4 -0"]
)
def test_numbers_of_a_line_in_any_spelling(tmp_path, numbers, more):
    (scan,), report = read(written(tmp_path, f"FLASER 2 {numbers} 100.5 host 0.1{more}\n"))
    assert report.scans_skipped == 0
    assert scan.ranges_m.tolist() == [1.0, 2.5]
    assert scan.pose_odom_base == SE2(3.0, 4.0, 0.0)
    assert all(type(value) is float for value in scan.pose_odom_base)
    assert scan.stamp_ns == 100_500_000_000


def test_corrected_logs_tell_no_place(tmp_path):
    """The first triple is a pose of another map: it drifts from the odometry."""
    drift = iter(range(1000))
    lines = carmen(WIDE, lambda scan: flaser(scan, SE2(0.01 * next(drift), 0.0, 0.0)))
    found, report = read(written(tmp_path, lines))
    assert found[0].pose_base_laser == SE2.identity()
    assert len(report.warnings) == 1
    found, report = read(written(tmp_path, lines), pose_base_laser=SE2(0.1, 0.0, 0.0))
    assert found[0].pose_base_laser == SE2(0.1, 0.0, 0.0)
    assert report.warnings == []


def test_a_correction_from_afar_is_no_place(tmp_path):
    lines = carmen(SCANS, lambda scan: flaser(scan, SE2(30.0, 0.0, 0.0)))
    assert read(written(tmp_path, lines))[0][0].pose_base_laser == SE2.identity()


def test_other_lines_are_passed_over(tmp_path):
    other = (
        "RLASER 3 1 1 1 0 0 0 0 0 0 1 h 1\nNEFF 12\nMARKER here\n# FLASER 2\n\n"
        "TRUEPOS 1 2 3 4 5 6\nGPSGGA garbage\n"
    )
    data = b"".join(other.encode() + flaser(scan).encode() for scan in SCANS)
    found, report = read(written(tmp_path, data.replace(b"\n", b"\r\n")))
    assert_same(found, SCANS_IN_CARMEN)
    assert report.scans_skipped == 0


SCANS_IN_CARMEN = [
    type(scan)(
        stamp_ns=scan.stamp_ns,
        ranges_m=scan.ranges_m,
        angle_min_rad=float32(-math.pi / 2),
        angle_increment_rad=float32(math.pi / 30),
        pose_odom_base=scan.pose_odom_base,
    )
    for scan in SCANS
]


def test_two_lasers_in_one_log_are_the_users_choice(tmp_path):
    path = written(tmp_path, carmen(SCANS, lambda scan: flaser(scan) + robotlaser(scan)))
    with pytest.raises(UsageError, match="--topic FLASER\n  --topic ROBOTLASER1"):
        read(path)
    for topic in ("FLASER", "ROBOTLASER1"):
        assert_same(read(path, topics=(topic,))[0], SCANS)


def test_poses_can_be_left_out(tmp_path):
    for data in (carmen(SCANS), csv(SCANS)):
        path = written(tmp_path, data)
        found, report = read(path, odom="none")
        assert_same(found, SCANS, odometry=False)
        assert report.odometry == "none"
        for asked in ("tf", "/odom"):
            with pytest.raises(UsageError, match="--odom"):
                read(path, odom=asked)


def test_a_log_without_scans(tmp_path):
    with pytest.raises(LogError, match="no scan"):
        read(written(tmp_path, "ODOM 1 2 3 4 5 6 7 h 8\nPARAM x y\n"))


# --- CSV --------------------------------------------------------------------------------------


def test_rows_as_people_write_them(tmp_path):
    text = (
        "\ufeff# by hand\n\n"
        'R1, r0 ,"t",angle_min,angle_increment,note,r2\r\n'
        "2,1,1.5,-0.5,0.25,hello,3 # good\r\n"
        ",inf,2.5,-0.5,0.25,,nan\n"
        "-inf,7,3.5,-0.5,0.25,x,1e39"
    )
    found, report = read(written(tmp_path, text))
    assert [scan.stamp_ns for scan in found] == [1500000000, 2500000000, 3500000000]
    expected = np.float32([[1, 2, 3], [np.inf, np.nan, np.nan], [7, -np.inf, np.inf]])
    np.testing.assert_array_equal([scan.ranges_m for scan in found], expected)
    assert found[0].pose_odom_base is None
    assert report.odometry == "none"
    assert report.scans_skipped == 0


@pytest.mark.parametrize(
    "respelt",
    [
        lambda text: text.replace(",", ";"),
        lambda text: text.replace(",", ";").replace(".", ","),
        lambda text: text.replace(",", "\t").replace(".", ","),
        lambda text: "\n".join(
            ",".join(f'"{cell.replace(".", ",")}"' for cell in line.split(","))
            for line in text.splitlines()
        ),
        lambda text: "\ufeff" + text.replace("\n", "\r\n").replace(",", ";"),
    ],
    ids=["semicolons", "decimal commas", "tabs", "quotes", "a spreadsheet's"],
)
def test_csv_as_spreadsheets_write_it(tmp_path, respelt):
    text = csv(SCANS).decode().partition("\n")[2]
    found, _ = read(written(tmp_path, respelt(text) + "\n"))
    assert_same(found, SCANS)


def test_what_is_no_number_is_said_plainly(tmp_path):
    lines = csv(SCANS).decode().splitlines()
    lines[3] = "nan" + lines[3][lines[3].index(",") :]
    found, report = read(written(tmp_path, "\n".join(lines) + "\n"))
    assert len(found) == len(SCANS) - 1
    said = " ".join(report.warnings)
    assert "line 4 of log: 'nan' is no whole number" in said


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ("t;r0;r1\n1;2;3\n".encode("utf-16"), "save it as UTF-8"),
        (b"\x89BSM\r\n\x1a\n", "a map and no log"),
        (b"PK\x03\x04 and so on", "unpack it"),
        (b"1.0,2.0,3.0\n", "a header row"),
    ],
)
def test_what_is_no_log_is_told_by_what_it_is(tmp_path, data, says):
    with pytest.raises(LogError, match=says):
        read(written(tmp_path, data))


def test_angles_from_the_command_line(tmp_path):
    path = written(tmp_path, "t,r0,r1,r2\n1,1,2,3\n")
    with pytest.raises(UsageError, match="--angle-min"):
        read(path)
    with pytest.raises(UsageError, match="--angle-increment"):
        read(path, angle_min_rad=-1.0)
    (scan,), _ = read(path, angle_min_rad=-1.0, angle_increment_rad=-0.5)
    assert scan.ranges_m.tolist() == [3, 2, 1]
    assert (scan.angle_min_rad, scan.angle_increment_rad) == (-2.0, 0.5)


@pytest.mark.parametrize(
    ("header", "says"),
    [
        ("r0,r1,angle_min", "stamp_ns or t"),
        ("t,r0,r2,angle_min", "without a hole"),
        ("t,x,y,theta", "r0, r1"),
    ],
)
def test_headers_that_lack_something(tmp_path, header, says):
    with pytest.raises(BsmapError, match=says):
        read(written(tmp_path, header + "\n1,2,3,4\n"))


def test_a_scan_that_changes_its_beams_survives_csv(tmp_path):
    scans = [some_scans(1, beams)[0] for beams in (20, 25, 20, 7)]
    assert write_log(tmp_path / "x.csv", scans, "csv") == 4
    found, _ = read(tmp_path / "x.csv")
    assert [len(scan.ranges_m) for scan in found] == [20, 25, 20, 7]
    assert_same(found, scans)


def test_what_only_some_scans_have_survives_csv(tmp_path):
    pose = SE2(0.1, -0.2, 0.5)
    scans = [
        type(scan)(
            stamp_ns=scan.stamp_ns,
            ranges_m=scan.ranges_m,
            angle_min_rad=scan.angle_min_rad,
            angle_increment_rad=scan.angle_increment_rad,
            range_min_m=float32(0.1),
            range_max_m=float32(30.1),
            time_increment_s=float32(-1.7e-5),
            pose_base_laser=pose,
            pose_odom_base=scan.pose_odom_base if i % 2 == 1 else None,
        )
        for i, scan in enumerate(SCANS)
    ]
    write_log(tmp_path / "x.csv", scans, "csv")
    found, report = read(tmp_path / "x.csv")
    assert_same(found, scans)
    assert report.warnings == []
    assert all(
        (scan.range_min_m, scan.range_max_m, scan.pose_base_laser)
        == (float32(0.1), float32(30.1), pose)
        for scan in found
    )


def test_what_has_no_column_is_not_dropped(tmp_path):
    scans = some_scans(300, 5)
    late = [dataclasses.replace(s, pose_odom_base=None) for s in scans[:250]] + scans[250:]
    with pytest.raises(LogError, match="mcap"):
        write_log(tmp_path / "x.csv", late, "csv")
    write_log(tmp_path / "x.csv", late[100:], "csv")
    assert_same(read(tmp_path / "x.csv")[0], late[100:])


def test_a_hanging_laser_by_option(tmp_path):
    path = written(tmp_path, csv(SCANS))
    found, _ = read(path, pose_base_laser=SE2(0.0, 0.0, 0.0), laser_flipped=True)
    np.testing.assert_array_equal(found[0].ranges_m, SCANS[0].ranges_m[::-1])


def test_seconds_have_nine_digits():
    assert Decimal(seconds(SCANS[3].stamp_ns)) * 10**9 == SCANS[3].stamp_ns


def test_a_row_without_beams_is_named(tmp_path):
    path = written(
        tmp_path, "t,angle_min,angle_increment,r0,r1\n1,0,0.1,1,2\n2,0,0.1\n3,0,0.1,1,2\n"
    )
    found, report = read(path)
    assert len(found) == 2
    assert report.first_fault == "line 3 of log: a scan without beams"
