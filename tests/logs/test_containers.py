"""The same scans in every container, encoding and compression are the same scans."""

import io
import os
import subprocess
import sys

import numpy as np
import pytest

from bsmap_cli.exchange.log_writers import write_log
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from tests.logs.making import (
    MAKERS,
    Ros,
    assert_same,
    messages_of,
    numbers,
    read,
    ros_bag,
    ros_mcap,
    some_scans,
)

SCANS = some_scans()


@pytest.mark.parametrize("kind", MAKERS)
def test_every_container_gives_the_same_scans(kind, tmp_path):
    found, report = read(MAKERS[kind](tmp_path / "log", SCANS))
    assert_same(found, SCANS)
    assert (report.scans_read, report.scans_skipped, report.truncated) == (200, 0, False)
    assert all(scan.pose_base_laser.as_array().tolist() == [0, 0, 0] for scan in found)
    place_is_told = "csv" not in kind
    assert (report.warnings == []) == place_is_told


@pytest.mark.parametrize("kind", MAKERS)
def test_every_container_streams(kind, tmp_path):
    path = MAKERS[kind](tmp_path / "log", SCANS[:60])
    if path.is_dir():
        path = next(child for child in path.iterdir() if child.name != "metadata.yaml")
    with path.open("rb") as file, open_log([_Pipe(file)], ReadOptions()) as reader:
        assert_same(list(reader.scans()), SCANS[:60])


class _Pipe(io.RawIOBase):
    """Gives a few bytes at a time and cannot seek."""

    def __init__(self, file):
        self._file = file

    def readable(self):
        return True

    def read(self, count=-1):
        return self._file.read(min(count, 777) if count >= 0 else -1)


def test_standard_input(tmp_path):
    path = MAKERS["mcap zstd"](tmp_path / "log", SCANS)
    code = (
        "from bsmap_cli.logs.open_log import open_log\n"
        "from bsmap_cli.logs.reader import ReadOptions\n"
        "with open_log(['-'], ReadOptions()) as reader: print(sum(1 for _ in reader.scans()))"
    )
    with path.open("rb") as file:
        done = subprocess.run(
            [sys.executable, "-c", code], stdin=file, capture_output=True, check=True, text=True
        )
    assert (done.stdout, done.stderr) == ("200\n", "")


@pytest.mark.parametrize("kind", ["mcap", "bag", "csv"])
def test_what_is_written_is_read(kind, tmp_path):
    path = tmp_path / "out"
    assert write_log(path, SCANS, kind) == 200
    found, report = read(path)
    assert_same(found, SCANS)
    again = tmp_path / "again"
    write_log(again, found, kind)
    assert again.read_bytes() == path.read_bytes()
    assert not report.truncated


@pytest.mark.parametrize("suffix", ["mcap", "bag", "db3", "clf", "csv"])
def test_parts_in_natural_order(suffix, tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    for number in range(12):
        part = SCANS[10 * number : 10 * number + 10]
        path = folder / f"part_{number}.{suffix}"
        kind = {"mcap": "mcap zstd", "db3": "lone db3", "clf": "carmen flaser"}.get(suffix, suffix)
        made = tmp_path / f"made{number}"
        made.mkdir()
        MAKERS[kind](made / "log", part).rename(path)
    (folder / "README.txt").write_text("not a log")
    os.mkfifo(folder / "pipe")  # nobody writes to it
    (folder / ".hidden.csv").write_text("t,r0,r1")
    assert_same(read(folder)[0], SCANS[:120])
    files = sorted(folder.glob(f"part*.{suffix}"))
    assert_same(read(files)[0], SCANS[:120])


def test_split_bag_keeps_the_mounting_of_its_first_part(tmp_path):
    ros = Ros()
    messages = list(messages_of(SCANS, ros))
    folder = tmp_path / "bag"
    folder.mkdir()
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {}")
    (folder / "bag_0.mcap").write_bytes(ros_mcap(messages[:201], ros))
    (folder / "bag_1.mcap").write_bytes(ros_mcap(messages[201:], ros))
    found, report = read(folder, start_s=6.0)
    assert found[0].stamp_ns >= SCANS[0].stamp_ns + 6 * 10**9
    assert report.warnings == []


def test_a_part_that_is_missing_is_told(tmp_path):
    folder = MAKERS["ros2 mcap"](tmp_path / "bag", SCANS)
    metadata = folder / "metadata.yaml"
    text = metadata.read_text()
    assert not read(folder)[1].truncated
    metadata.write_text(text.replace("  - bag.mcap\n", "  - bag.mcap\n  - bag_1.mcap\n", 1))
    found, report = read(folder)
    assert len(found) == 200
    assert report.truncated
    assert "bag_1.mcap" in report.warnings[0]


def test_a_link_to_nowhere_is_a_part_that_is_missing(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    MAKERS["csv"](folder / "part_1.csv", SCANS[:9])
    (folder / "part_2.csv").symlink_to(tmp_path / "nowhere")
    found, report = read(folder)
    assert_same(found, SCANS[:9])
    assert report.truncated
    assert "part_2.csv is missing" in report.warnings[0]


def test_a_file_that_can_be_read_in_part(tmp_path):
    """What a bad sector leaves of a log is used."""

    class Failing(io.BytesIO):
        def read(self, count=-1, /):
            if self.tell() > len(data) // 2:
                raise OSError(5, "Input/output error")
            return super().read(count)

        read1 = read

    for kind in ("mcap zstd", "bag", "csv", "carmen.gz"):
        (tmp_path / kind).mkdir()
        data = MAKERS[kind](tmp_path / kind / "log", SCANS).read_bytes()
        found, report = read(Failing(data))
        assert_same(found, SCANS[: len(found)])
        assert report.truncated
        assert any("reading fails (Input/output error)" in warning for warning in report.warnings)
        assert len(found) > 50, kind


def test_bags_without_definitions(tmp_path):
    """ROS 2 bags older than Iron carry none."""
    import sqlite3

    path = MAKERS["lone db3"](tmp_path / "log", SCANS)
    with sqlite3.connect(path) as database:
        database.execute("DROP TABLE message_definitions")
    database.close()
    assert_same(read(path)[0], SCANS)
    ros = Ros()
    empty = dict.fromkeys(("sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry"), b"")
    path.write_bytes(ros_mcap(messages_of(SCANS, ros), ros, schemas=empty))
    assert_same(read(path)[0], SCANS)


def test_ranges_survive_text():
    values = np.random.default_rng(1).uniform(0, 100, 2000).astype(np.float32)
    back = np.array(numbers(values.tolist()).split(), dtype=np.float64).astype(np.float32)
    np.testing.assert_array_equal(back, values)


def test_written_logs_open_in_other_readers(tmp_path):
    from mcap.reader import make_reader
    from rosbags.highlevel import AnyReader

    write_log(tmp_path / "x.mcap", SCANS, "mcap")
    with (tmp_path / "x.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        topics = [channel.topic for _, channel, _ in reader.iter_messages()]
    assert (topics.count("/scan"), topics.count("/odom")) == (200, 200)
    write_log(tmp_path / "x.bag", SCANS, "bag")
    for path in (tmp_path / "x.bag", tmp_path / "x.mcap"):
        with AnyReader([path]) as reader:
            messages = [
                reader.deserialize(data, connection.msgtype)
                for connection, _, data in reader.messages()
                if connection.topic == "/scan"
            ]
        assert len(messages) == 200
        np.testing.assert_array_equal(messages[7].ranges, SCANS[7].ranges_m)


def test_an_unclosed_bag_is_read(tmp_path):
    path = ros_bag(tmp_path / "log", messages_of(SCANS, Ros(is_ros1=True)))
    data = bytearray(path.read_bytes())
    at = data.index(b"index_pos=") + len(b"index_pos=")
    data[at : at + 8] = bytes(8)
    path.write_bytes(data[: data.rindex(b"topic=/scan") - 200])
    found, report = read(path)
    assert report.truncated
    assert len(found) > 190


def test_a_named_pipe_is_read_once(tmp_path):
    """`bsmap slam <(zcat log.clf.gz)` names a file that cannot be opened twice."""
    import os
    import threading

    data = MAKERS["carmen.gz"](tmp_path / "log", SCANS).read_bytes()
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_bytes, args=(data,))
    writer.start()
    found, _ = read(pipe)
    writer.join()
    assert_same(found, SCANS)


def test_memory_does_not_grow_with_the_log(tmp_path):
    import tracemalloc

    for kind in ("mcap zstd", "bag", "lone db3", "csv.gz", "carmen flaser"):
        folder = tmp_path / kind
        folder.mkdir()
        path = MAKERS[kind](folder / "log", some_scans(3000, 181))
        with open_log([path], ReadOptions()) as reader:
            scans = reader.scans()
            for _ in range(500):
                next(scans)
            tracemalloc.start()
            count = sum(1 for _ in scans)
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
        assert count == 2500
        assert peak < 1.5e6, kind
