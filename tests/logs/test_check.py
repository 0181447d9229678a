"""What a check says about logs with one known fault each."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.check import check_log
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.sensor.scan import Scan
from tests.logs.making import (
    SCAN,
    SECOND_NS,
    TF,
    Ros,
    csv,
    float32,
    messages_of,
    ros_mcap,
)

ROS = Ros()
T0 = 1_500_000_000 * SECOND_NS
BEAMS = 271
LOW, STEP = float32(-math.pi * 0.75), float32(math.pi * 1.5 / (BEAMS - 1))


def seen_from(yaw):
    """A room of unequal walls, turned against."""
    angles = LOW + np.arange(BEAMS) * STEP + yaw
    return np.float32(5.0 + 2.0 * np.sin(angles) + np.cos(3.0 * angles) + 0.4 * np.sin(7 * angles))


def a_drive(count=200, *, odometry=True, turn=0.02, step=0.05):
    scans = []
    for i in range(count):
        pose = SE2.from_array((step * i, 0.0, turn * i))
        scans.append(
            Scan(
                stamp_ns=T0 + i * SECOND_NS // 20,
                ranges_m=seen_from(pose.theta),
                angle_min_rad=LOW,
                angle_increment_rad=STEP,
                range_max_m=30.0,
                pose_odom_base=pose if odometry else None,
            )
        )
    return scans


def findings(tmp_path: Path, scans=None, data=None, **options):
    path = tmp_path / "log"
    path.write_bytes(data if data is not None else ros_mcap(messages_of(scans, ROS), ROS))
    with open_log([path], ReadOptions(**options)) as reader:
        return {finding.name: finding for finding in check_log(reader)}


def changed(scans, index, **fields):
    return [dataclasses.replace(s, **fields) if i == index else s for i, s in enumerate(scans)]


def test_a_good_log_has_no_findings(tmp_path):
    assert findings(tmp_path, a_drive()) == {}
    assert set(findings(tmp_path, a_drive(odometry=False))) == {"odometry"}


@pytest.mark.parametrize("limit", [math.inf, 30_000.0])
def test_millimetres(tmp_path, limit):
    scans = [
        dataclasses.replace(scan, ranges_m=scan.ranges_m * np.float32(1000), range_max_m=limit)
        for scan in a_drive()
    ]
    found = findings(tmp_path, scans)["units"]
    assert found.level == "problem"
    assert "millimetres" in found.remedy
    assert 3000 < found.value < 8000


@pytest.mark.parametrize(("odometry", "level"), [(True, "warning"), (False, "problem")])
def test_gaps(tmp_path, odometry, level):
    scans = a_drive(odometry=odometry)
    scans = [
        dataclasses.replace(scan, stamp_ns=scan.stamp_ns + (3 * SECOND_NS if i >= 100 else 0))
        for i, scan in enumerate(scans)
    ]
    found = findings(tmp_path, scans)["gaps"]
    assert found.level == level
    assert found.value == pytest.approx(3.05)
    assert "at 5.0 s" in found.message or "at 4.9" in found.message


def test_stamps(tmp_path):
    scans = changed(a_drive(), 50, stamp_ns=T0)
    found = findings(tmp_path, scans)["stamps"]
    assert found.value == pytest.approx(2.45)
    scans = a_drive()
    scans = changed(scans, 50, stamp_ns=scans[49].stamp_ns)
    assert findings(tmp_path, scans)["repeated stamps"].value == 1


def test_beams_and_returns(tmp_path):
    scans = a_drive()
    fewer = changed(scans, 7, ranges_m=scans[7].ranges_m[:200])
    assert set(findings(tmp_path, fewer)) == {"beams"}
    nothing = np.full(BEAMS, np.inf, np.float32)
    assert findings(tmp_path, changed(scans, 7, ranges_m=nothing))["blind scans"].value == 1
    half = scans[0].ranges_m.copy()
    half[: BEAMS * 2 // 3] = 0.0
    found = findings(tmp_path, [dataclasses.replace(scan, ranges_m=half) for scan in scans])
    assert found["returns"].value == pytest.approx(2 / 3, abs=0.01)


def test_steps_by_odometry_and_by_scans(tmp_path):
    assert "steps" not in findings(tmp_path, a_drive(step=0.39))
    found = findings(tmp_path, a_drive(step=0.41))["steps"]
    assert (found.value, found.level) == (199, "warning")
    fast = a_drive(odometry=False, turn=math.radians(41.0))
    found = findings(tmp_path, fast)["steps"]
    assert found.value > 190
    assert found.level == "problem"
    slow = a_drive(odometry=False, turn=math.radians(20.0))
    assert "steps" not in findings(tmp_path, slow)


def test_mounting_clocks_skipped_and_damage(tmp_path):
    scans = a_drive(odometry=False)
    late = [("/scan", SCAN, scan.stamp_ns + 7 * SECOND_NS, ROS.scan(scan)) for scan in scans]
    late[9] = (*late[9][:3], b"nothing")
    data = ros_mcap(late, ROS)
    found = findings(tmp_path, data=data)
    assert set(found) == {"mounting", "clocks", "skipped", "odometry"}
    assert found["clocks"].value == pytest.approx(7.0)
    assert found["skipped"].value == 1
    assert all(finding.remedy for finding in found.values())
    assert findings(tmp_path, data=data[: len(data) // 2])["damage"].level == "problem"


def test_a_clock_that_was_set(tmp_path):
    for jump_s, way in ((-1_000_000_000, "back by 1000000000 s"), (86_400, "ahead by 86400 s")):
        scans = [
            dataclasses.replace(s, stamp_ns=s.stamp_ns + (jump_s * SECOND_NS if i > 90 else 0))
            for i, s in enumerate(a_drive())
        ]
        found = findings(tmp_path, scans)
        assert way in found["clock set"].message
        assert "gaps" not in found


@pytest.mark.parametrize("stamp_ns", [0, 5 * SECOND_NS])
def test_stamps_that_are_none(tmp_path, stamp_ns):
    log = [
        (topic, kind, at_ns, ROS.scan(scan, stamp_ns=stamp_ns) if topic == "/scan" else message)
        for scan in a_drive()
        for topic, kind, at_ns, message in list(messages_of([scan], ROS))[1:]
    ]
    found = findings(tmp_path, data=ros_mcap(log, ROS))["no stamps"]
    assert "/scan" in found.message


@pytest.mark.parametrize("fault", ["tilt", "moving laser"])
def test_lasers_that_do_not_sweep_the_plane(tmp_path, fault):
    scans = a_drive(30)
    at_ns = scans[0].stamp_ns
    angles = [math.radians(20.0)] if fault == "tilt" else [0.0, math.radians(5.0)]
    mountings = [
        ROS.transforms(
            (at_ns, "base_link", "laser", (0.1, 0, 0.2), (0, math.sin(a / 2), 0, math.cos(a / 2)))
        )
        for a in angles
    ]
    log = [("/tf", TF, at_ns, mounting) for mounting in mountings]
    log += [message for message in messages_of(scans, ROS) if message[0] != "/tf_static"]
    found = findings(tmp_path, data=ros_mcap(log, ROS))
    assert set(found) == {fault}
    assert found[fault].level == "problem"


def test_the_robot_in_its_own_view(tmp_path):
    scans = a_drive(turn=0.1)
    assert findings(tmp_path, scans) == {}
    posts = {20: (0.3, range(18, 23)), 200: (0.45, range(199, 202))}
    seen = []
    for index, scan in enumerate(scans):
        ranges = scan.ranges_m.copy()
        for range_m, beams in posts.values():
            ranges[list(beams)] = range_m + 0.01 * (index % 3)
        seen.append(dataclasses.replace(scan, ranges_m=ranges))
    found = findings(tmp_path, seen)["robot in view"]
    for beam, (range_m, beams) in posts.items():
        low, high = (math.degrees(LOW + STEP * edge) for edge in (beams[0] - 0.5, beams[-1] + 0.5))
        flag = f"--ignore-angles {math.floor(low)},{math.ceil(high)}"
        assert flag in found.remedy, beam
        assert f"{range_m:.2f} m" in found.message
    assert "robot in view" not in findings(tmp_path, seen[:40])
    still = [dataclasses.replace(seen[0], stamp_ns=scan.stamp_ns) for scan in seen]
    assert "robot in view" not in findings(tmp_path, still)


def test_the_gravest_comes_first(tmp_path):
    path = tmp_path / "log"
    path.write_bytes(csv(a_drive(odometry=False))[:-500])
    with open_log([path], ReadOptions()) as reader:
        levels = [finding.level for finding in check_log(reader)]
    assert levels == sorted(levels, key=("problem", "warning", "note").index)
    assert len(levels) == 3
