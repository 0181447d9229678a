"""Which topics, which laser's place, which part of a log."""

import math
import shlex

import numpy as np
import pytest

from bsmap_cli.errors import LogError, UsageError
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import canonical_pose
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from tests.logs.making import (
    MAKERS,
    SCAN,
    SECOND_NS,
    TF,
    Ros,
    messages_of,
    planar,
    read,
    ros_mcap,
    some_scans,
)

ROS = Ros()
T0 = 1_500_000_000 * SECOND_NS
MS = 1_000_000
SCANS = some_scans(60, 31, odometry=False)


def written(tmp_path, messages, **options):
    path = tmp_path / "run3.mcap"
    path.write_bytes(ros_mcap(messages, ROS, **options))
    return path


def on(topic, frame="laser", count=40, start=0):
    """Scans 50 ms apart, `start` milliseconds after the first."""
    stamps = [T0 + (start + i * 50) * MS for i in range(count)]
    return [
        (topic, SCAN, stamp, ROS.scan(SCANS[i % 60], frame, stamp_ns=stamp))
        for i, stamp in enumerate(stamps)
    ]


def merged(*lists):
    return sorted((m for part in lists for m in part), key=lambda message: message[2])


def test_two_topics_are_the_users_choice(tmp_path):
    path = written(tmp_path, merged(on("/front/scan"), on("/rear/scan", start=7)))
    with pytest.raises(UsageError) as caught:
        read(path)
    lines = str(caught.value).splitlines()
    assert "run3.mcap has 2 scan topics" in lines[0]
    assert lines[1:] == ["  --topic /front/scan", "  --topic /rear/scan"]
    for asked in ("/rear/scan", "rear/scan"):
        found, _ = read(path, topics=(asked,))
        assert {scan.topic for scan in found} == {"/rear/scan"}
    found, _ = read(path, topics=("/front/scan", "/rear/scan"))
    assert [scan.topic for scan in found[:4]] == ["/front/scan", "/rear/scan"] * 2


def test_flags_to_choose_with_are_ready_for_a_shell(tmp_path):
    topics = ["/my scan", "/it's", *(f"/s{i:03d}" for i in range(40))]
    path = tmp_path / "log.mcap"
    path.write_bytes(ros_mcap([message for t in topics for message in on(t, count=1)], ROS))
    with pytest.raises(UsageError) as caught:
        read(path)
    _, *flags, last = str(caught.value).splitlines()
    said = [shlex.split(line) for line in flags]
    assert all(flag == "--topic" and topic in topics for flag, topic in said)
    assert ["--topic", "/my scan"] in said
    assert ["--topic", "/it's"] in said
    assert len(str(caught.value)) < 600
    assert f"{len(topics) - len(flags)} more" in last


def test_a_place_that_comes_late(tmp_path):
    """A file with an index is read on until it comes; a stream has no such patience."""
    pose = canonical_pose(0.25, -0.5, math.pi / 2)
    static = ROS.transforms(planar(T0, "base_link", "laser", pose))
    messages = merged(on("/scan", count=300), [("/tf_static", TF, T0 + 9000 * MS, static)])
    path = written(tmp_path, messages)
    found, report = read(path)
    assert len(found) == 300
    assert {scan.pose_base_laser for scan in found} == {pose}
    assert report.warnings == []
    with path.open("rb") as stream:
        found, report = read(stream)
    assert len(found) == 300
    assert {scan.pose_base_laser for scan in found} == {SE2.identity()}
    assert report.places_unknown
    assert "--laser-pose 0.25,-0.5,90" in report.warnings[1]
    assert read(path, pose_base_laser=SE2(1.0, 0.0, 0.0))[1].warnings == []


def test_a_topic_that_starts_later_counts_where_an_index_tells(tmp_path):
    messages = merged(on("/front/scan", count=100), on("/rear/scan", start=3000))
    with pytest.raises(UsageError):
        read(written(tmp_path, messages))
    path = written(tmp_path, messages, use_statistics=False)
    found, _ = read(path)
    assert {scan.topic for scan in found} == {"/front/scan"}
    found, _ = read(path, topics=("/rear/scan",))
    assert len(found) == 40


def test_topics_that_are_not_there_or_no_scans(tmp_path):
    tf = ("/tf", TF, T0, ROS.transforms(planar(T0, "odom", "base_link", SE2.identity())))
    path = written(tmp_path, [tf, *on("/scan")])
    with pytest.raises(UsageError, match="--topic /scan"):
        read(path, topics=("/scam",))
    with pytest.raises(UsageError, match="TFMessage"):
        read(path, topics=("/tf",))
    with pytest.raises(LogError, match=r"no scan topic.*/tf \(tf2_msgs/msg/TFMessage\)"):
        read(written(tmp_path, [tf]))
    with pytest.raises(LogError, match="no messages"):
        read(written(tmp_path, []))


def test_two_lasers_have_their_own_places(tmp_path):
    static = ROS.transforms(
        planar(T0, "base_link", "front", SE2(0.3, 0.0, 0.0)),
        planar(T0, "base_link", "rear", SE2(-0.3, 0.0, math.pi)),
    )
    messages = merged(on("/a", "front"), on("/b", "rear", start=1))
    path = written(tmp_path, [("/tf_static", TF, T0, static), *messages])
    found, report = read(path, topics=("/a", "/b"), every=2)
    assert [scan.topic for scan in found[:2]] == ["/a", "/b"]
    assert found[0].pose_base_laser == SE2(0.3, 0.0, 0.0)
    assert found[1].pose_base_laser == SE2(-0.3, 0.0, math.pi)
    assert report.warnings == []


@pytest.mark.parametrize("gives", ["tf", "option"])
def test_a_laser_that_hangs(gives, tmp_path):
    """Turned about its x axis, beams that run to the left run to the right."""
    turned = (T0, "base_link", "laser", (0.1, 0.2, 1.5), (1.0, 0.0, 0.0, 0.0))
    messages = on("/scan")
    options = {}
    if gives == "tf":
        messages = [("/tf_static", TF, T0, ROS.transforms(turned)), *messages]
    else:
        options = {"pose_base_laser": SE2(0.1, 0.2, 0.0), "laser_flipped": True}
    found, report = read(written(tmp_path, messages), **options)
    np.testing.assert_array_equal(found[0].ranges_m, SCANS[0].ranges_m[::-1])
    assert found[0].angle_min_rad == pytest.approx(-SCANS[0].angle_min_rad - math.pi)
    assert (found[0].pose_base_laser.x, found[0].pose_base_laser.y) == (0.1, 0.2)
    assert report.warnings == []


def test_frames_with_slashes_and_prefixes(tmp_path):
    static = ROS.transforms(
        planar(T0, "/robot/base_footprint", "/robot/base_link", SE2(0.1, 0.0, 0.0)),
        planar(T0, "/robot/base_link", "/robot/laser", SE2(0.2, 0.0, 0.0)),
    )
    path = written(tmp_path, [("/tf_static", TF, T0, static), *on("/scan", "robot/laser")])
    found, report = read(path)
    assert found[0].pose_base_laser.x == pytest.approx(0.3)
    assert report.warnings == []


def test_an_unknown_place_is_told_once(tmp_path):
    found, report = read(written(tmp_path, on("/scan")))
    assert found[0].pose_base_laser == SE2.identity()
    assert len(report.warnings) == 1
    assert "--laser-pose" in report.warnings[0]
    _, report = read(written(tmp_path, on("/scan", "base_link")))
    assert report.warnings == []


def test_another_robots_tree_is_not_ours(tmp_path):
    static = ROS.transforms(planar(T0, "camera", "camera_optical", SE2(1.0, 0.0, 0.0)))
    path = written(tmp_path, [("/tf_static", TF, T0, static), *on("/scan")])
    assert "--laser-pose" in read(path)[1].warnings[0]


@pytest.mark.parametrize("kind", ["mcap zstd", "bag", "carmen flaser", "csv"])
def test_start_end_every_and_so_many(kind, tmp_path):
    scans = [s for i, s in enumerate(some_scans(200)) if i % 17]
    path = MAKERS[kind](tmp_path / "log", scans)
    first = scans[0].stamp_ns

    def expected(start=-1e9, end=1e9, every=1, most=None):
        inside = [s.stamp_ns for s in scans if start <= (s.stamp_ns - first) / SECOND_NS <= end]
        return inside[::every][:most]

    for options, stamps in [
        ({}, expected()),
        ({"start_s": 2.0}, expected(start=2.0)),
        ({"end_s": 3.5}, expected(end=3.5)),
        ({"start_s": 1.0, "end_s": 3.0, "every": 3}, expected(1.0, 3.0, 3)),
        ({"every": 7, "max_scans": 4}, expected(every=7, most=4)),
        ({"max_scans": 0}, []),
    ]:
        found, report = read(path, **options)
        assert [scan.stamp_ns for scan in found] == stamps
        assert report.scans_read == len(stamps)
        assert report.scans_skipped == 0
    with pytest.raises(LogError, match="no scan at the time asked for"):
        read(path, start_s=1e6)


def test_changing_beam_counts(tmp_path):
    messages = []
    for i in range(30):
        (scan,) = some_scans(1, 20 + i % 3, odometry=False)
        messages.append(("/scan", SCAN, T0 + i * MS, ROS.scan(scan, stamp_ns=T0 + i * MS)))
    found, report = read(written(tmp_path, messages))
    assert [len(scan.ranges_m) for scan in found] == [20, 21, 22] * 10
    assert report.scans_skipped == 0


@pytest.mark.parametrize("kind", ["mcap zstd", "mcap no summary", "bag", "lone db3", "mcap json"])
def test_info_of_messages(kind, tmp_path):
    scans = some_scans()
    with open_log([MAKERS[kind](tmp_path / "log", scans)], ReadOptions()) as reader:
        info = reader.info()
    odometry = "/odom_pose" if "json" in kind else "/odom"
    topics = {topic.topic: topic for topic in info.topics}
    assert (info.selected, info.odometry, info.beams) == (("/scan",), odometry, 181)
    assert topics["/scan"].messages == topics[odometry].messages == 200
    assert topics["/scan"].usable
    assert topics["/scan"].frame == "laser"
    assert not topics[odometry].usable
    stamps = [scan.stamp_ns for scan in scans]
    duration_s = (max(stamps) - min(stamps)) / SECOND_NS
    assert info.duration_s == pytest.approx(duration_s)
    assert topics["/scan"].rate_hz == pytest.approx(199 / duration_s)


def test_info_of_text(tmp_path):
    for kind, topic in (("carmen flaser", "FLASER"), ("csv", "csv")):
        with open_log([MAKERS[kind](tmp_path / "log", some_scans())], ReadOptions()) as reader:
            info = reader.info()
        assert (info.selected, info.beams) == ((topic,), 181)
        assert info.odometry == "poses in the log"
        assert sum(t.messages for t in info.topics if t.usable) == 200


def test_info_leaves_the_choice_open(tmp_path):
    path = written(tmp_path, merged(on("/front/scan"), on("/rear/scan", start=7)))
    with open_log([path], ReadOptions()) as reader:
        assert reader.info().selected == ()


def test_reading_can_be_left_early(tmp_path):
    for kind in ("mcap zstd", "bag", "lone db3", "carmen.gz", "csv.zst"):
        folder = tmp_path / kind
        folder.mkdir()
        path = MAKERS[kind](folder / "log", some_scans())
        with open_log([path], ReadOptions()) as reader:
            assert next(iter(reader.scans())).stamp_ns == 1_300_000_000_000_000_001


def test_messages_of_is_what_it_says():
    """The maker's own order: the place, then odometry before its scan."""
    topics = [message[0] for message in messages_of(some_scans(2), ROS)]
    assert topics == ["/tf_static", "/odom", "/scan", "/odom", "/scan"]
