"""Logs that are written: whole or not at all, the same bytes each time, nothing invented."""

import dataclasses
import io

import numpy as np
import pytest

from bsmap_cli.errors import LogError, UsageError
from bsmap_cli.exchange.log_writers import write_log
from bsmap_cli.geometry.se2 import SE2
from tests.logs.making import assert_same, float32, read, some_scans

SCANS = some_scans(50, 31)
FORMATS = ["mcap", "bag", "csv"]


class Pipe(io.RawIOBase):
    """Can be written, and nothing else."""

    def __init__(self):
        self.data = b""

    def writable(self):
        return True

    def write(self, data):
        self.data += bytes(data)
        return len(data)


@pytest.mark.parametrize("kind", FORMATS)
def test_a_stream_and_a_file_get_the_same_bytes(kind, tmp_path):
    pipe = Pipe()
    assert write_log(pipe, iter(SCANS), kind) == 50
    path = tmp_path / "log"
    path.write_text("older")
    assert write_log(path, iter(SCANS), kind) == 50
    assert path.read_bytes() == pipe.data


@pytest.mark.parametrize("kind", FORMATS)
def test_a_failure_leaves_the_folder_as_it_was(kind, tmp_path):
    def failing():
        yield from SCANS[:9]
        raise KeyboardInterrupt

    path = tmp_path / "log"
    path.write_text("older")
    with pytest.raises(KeyboardInterrupt):
        write_log(path, failing(), kind)
    assert [child.name for child in tmp_path.iterdir()] == ["log"]
    assert path.read_text() == "older"


@pytest.mark.parametrize("kind", FORMATS)
def test_all_fields_of_a_scan_come_back(kind, tmp_path):
    scans = [
        dataclasses.replace(
            scan,
            range_min_m=float32(0.05),
            range_max_m=float32(29.9),
            time_increment_s=float32(1.7e-5),
            pose_base_laser=SE2(0.25, -0.125, 0.5),
        )
        for scan in SCANS
    ]
    write_log(tmp_path / "log", scans, kind)
    found, report = read(tmp_path / "log")
    assert_same(found, scans)
    assert report.warnings == []
    for a, b in zip(found, scans, strict=True):
        assert (a.range_min_m, a.range_max_m) == (b.range_min_m, b.range_max_m)
        assert a.pose_base_laser == b.pose_base_laser


@pytest.mark.parametrize("kind", ["mcap", "bag"])
def test_two_lasers_keep_their_topics_and_places(kind, tmp_path):
    places = {"/front": SE2(0.5, 0.0, 0.0), "/rear": SE2(-0.5, 0.0, 3.0)}
    scans = [
        dataclasses.replace(scan, topic=topic, pose_base_laser=places[topic])
        for scan, topic in zip(SCANS, ["/front", "/rear"] * 25, strict=True)
    ]
    write_log(tmp_path / "log", scans, kind)
    found, _ = read(tmp_path / "log", topics=("/front", "/rear"))
    assert [scan.topic for scan in found] == [scan.topic for scan in scans]
    for scan in found:
        place = places[scan.topic].as_array()
        np.testing.assert_allclose(scan.pose_base_laser.as_array(), place, atol=1e-9)


@pytest.mark.parametrize("kind", ["mcap", "bag"])
@pytest.mark.parametrize("stamp_ns", [-1, 2**31 * 10**9])
def test_stamps_that_ros_cannot_hold(kind, stamp_ns, tmp_path):
    scan = dataclasses.replace(SCANS[0], stamp_ns=stamp_ns)
    with pytest.raises(LogError, match="csv"):
        write_log(tmp_path / "log", [scan], kind)
    assert list(tmp_path.iterdir()) == []
    write_log(tmp_path / "log", [scan], "csv")
    assert read(tmp_path / "log")[0][0].stamp_ns == stamp_ns


def test_another_format_is_refused(tmp_path):
    with pytest.raises(UsageError, match="mcap, bag or csv"):
        write_log(tmp_path / "log", SCANS, "xls")
