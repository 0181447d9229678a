"""Cut, damaged and hostile logs: never a foreign error, never a hang, every good scan is used."""

import struct
import tracemalloc
from dataclasses import replace
from itertools import takewhile

import numpy as np
import pytest

from bsmap_cli.errors import BsmapError
from tests.logs.making import (
    MAKERS,
    SCAN,
    Ros,
    carmen,
    csv,
    messages_of,
    read,
    ros_mcap,
    some_scans,
)

SCANS = some_scans(80, 61)
KINDS = [kind for kind in MAKERS if not kind.startswith("ros2")]
TEXT = ("carmen flaser", "csv", "csv seconds", "carmen robotlaser", "carmen rawlaser")
EXACT = ("mcap no chunks", "mcap plain chunks", "bag", *TEXT)
CHUNKED = [kind for kind in KINDS if kind.startswith("mcap ") and kind != "mcap no chunks"]
CHECKED = [*CHUNKED, "mcap no chunks", *(kind for kind in KINDS if kind.endswith(("gz", "zst")))]
A_CHUNK = 40  # scans


def try_to_read(path):
    """The scans before the fault, or none and no report where the log is refused."""
    try:
        return read(path)
    except BsmapError as error:
        assert str(error)
        assert "\n" not in str(error)
        return [], None


def is_same(a, b):
    return (
        a.stamp_ns == b.stamp_ns
        and np.array_equal(a.ranges_m, b.ranges_m, equal_nan=True)
        and a.angle_min_rad == b.angle_min_rad
    )


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    made = {}

    def make(kind):
        if kind not in made:
            path = MAKERS[kind](tmp_path_factory.mktemp("whole") / "log", SCANS)
            made[kind] = path.read_bytes()
        return made[kind]

    return make


def ends_of(data, kind):
    """Where the bytes of each scan end, in a file without compression."""
    if kind in TEXT:
        lines = data.splitlines(keepends=True)
        ends = np.cumsum([len(line) for line in lines])
        is_scan = [
            line.startswith((b"FLASER", b"ROBOTLASER1", b"RAWLASER1", b"1")) for line in lines
        ]
        return [int(end) for end, scan in zip(ends, is_scan, strict=True) if scan]
    beams = len(SCANS[0].ranges_m)
    return [data.index(scan.ranges_m.tobytes()) + 8 * beams + 4 for scan in SCANS]


@pytest.mark.parametrize("kind", KINDS)
def test_cut_anywhere(kind, whole, tmp_path):
    data = whole(kind)
    path = tmp_path / "log"
    counts = []
    for twentieth in range(20):
        end = len(data) * (2 * twentieth + 1) // 40
        path.write_bytes(data[:end])
        found, report = try_to_read(path)
        good = sum(is_same(a, b) for a, b in zip(found, SCANS, strict=False))
        assert good >= len(found) - (kind in TEXT), "a cut line of text may lose digits"
        if report is not None and kind not in TEXT and good < len(SCANS):
            assert report.truncated
        if kind in EXACT:
            expected = sum(last <= end for last in ends_of(data, kind))
            assert good in (expected, expected + 1), "every scan before the cut is used"
        counts.append(good)
    assert counts == sorted(counts)
    if not kind.endswith("zst"):  # whose one block is all or nothing
        assert counts[-1] > 0.6 * len(SCANS)


@pytest.mark.parametrize("kind", KINDS)
def test_a_flipped_byte_anywhere(kind, whole, tmp_path):
    data = whole(kind)
    path = tmp_path / "log"
    for twentieth in range(20):
        at = len(data) * (2 * twentieth + 1) // 40
        path.write_bytes(data[:at])
        before, _ = try_to_read(path)
        flipped = bytearray(data)
        flipped[at] ^= 0x55
        path.write_bytes(flipped)
        found, report = try_to_read(path)
        leading = sum(takewhile(bool, (is_same(a, b) for a, b in zip(found, SCANS, strict=False))))
        if kind in EXACT and kind not in CHUNKED:
            assert leading >= len(before) - 1, "every scan before the fault is used"
        elif not kind.endswith("zst"):  # of a block or a page, what is behind its checksum
            assert leading >= len(before) - A_CHUNK
        if kind in CHECKED and leading < len(SCANS):
            assert report is None or report.truncated, "the checksum must tell"
        if kind in CHUNKED:
            good = sum(any(is_same(a, b) for b in SCANS) for a in found)
            assert good == len(found), "a damaged chunk must not be used"


@pytest.mark.parametrize("kind", ["mcap zstd", "bag lz4", "lone db3", "csv", "carmen flaser"])
def test_every_cut_of_the_first_bytes(kind, whole, tmp_path):
    path = tmp_path / "log"
    for end in range(0, 300, 7):
        path.write_bytes(whole(kind)[:end])
        try_to_read(path)


def test_a_damaged_chunk_costs_that_chunk_alone(tmp_path):
    ros = Ros()
    data = bytearray(ros_mcap(messages_of(SCANS, ros), ros, chunk_size=2000))
    data[len(data) // 2] ^= 0xFF
    path = tmp_path / "log"
    path.write_bytes(data)
    found, report = read(path)
    assert report.truncated
    assert 60 < len(found) < 80
    assert found[-1].stamp_ns == SCANS[-1].stamp_ns


def test_declared_lengths_allocate_nothing(tmp_path, whole):
    """A file of a kilobyte that claims four gigabytes, in every length that a format has."""
    huge = struct.pack("<I", 0xFFFFFFF0)
    for kind in ("mcap no chunks", "mcap zstd", "mcap lz4", "bag", "bag lz4", "bag bz2"):
        data = whole(kind)[:1500]
        for at in range(8, 1400, 23):
            path = tmp_path / "log"
            path.write_bytes(data[:at] + huge + data[at + 4 :])
            tracemalloc.start()
            try_to_read(path)
            peak = tracemalloc.get_traced_memory()[1]
            tracemalloc.stop()
            assert peak < 50e6, (kind, at)


def test_bombs_do_not_fill_the_memory(tmp_path):
    import gzip

    import zstandard

    path = tmp_path / "log"
    zeros = bytes(300_000_000)
    for data in (gzip.compress(zeros, 1), zstandard.compress(zeros)):
        path.write_bytes(data)
        tracemalloc.start()
        with pytest.raises(BsmapError):
            read(path)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert peak < 300e6


def test_bad_messages_are_skipped_and_counted(tmp_path):
    ros = Ros()
    messages = []
    for index, message in enumerate(messages_of(SCANS, ros)):
        messages.append(message)
        if index % 20 == 0:
            messages.append(("/scan", SCAN, message[2], b"\0\1\0\0 no scan at all"))
        if index % 30 == 0:
            messages.append(("/scan", SCAN, message[2], ros.scan(SCANS[0], angle_min=np.nan)))
    path = tmp_path / "log"
    path.write_bytes(ros_mcap(messages, ros))
    found, report = read(path)
    assert len(found) == report.scans_read == 80
    assert report.scans_skipped == 9 + 6
    assert len(report.warnings) == 1


@pytest.mark.parametrize("kind", MAKERS)
def test_one_bad_scan_in_a_hundred(kind, tmp_path):
    """A sweep of one beam in every format, and angles that are none where there are any."""
    bad = {
        13: replace(SCANS[13], ranges_m=SCANS[13].ranges_m[:1]),
        14: replace(SCANS[14], angle_increment_rad=np.nan),
    }
    mixed = [bad.get(index, scan) for index, scan in enumerate(SCANS)]
    if kind in ("carmen flaser", "carmen.gz", "carmen.zst"):
        mixed[14] = bad[13]
    found, report = read(MAKERS[kind](tmp_path / "log", mixed))
    assert [scan.stamp_ns for scan in found] == [
        scan.stamp_ns for index, scan in enumerate(SCANS) if index not in bad
    ]
    assert (report.scans_skipped, report.truncated) == (2, False)
    assert sum("skipped" in warning for warning in report.warnings) == 1


WRONG = [b"float32 nothing", b"\xff\xfe\0", b"string ranges", b"x" * 999, b""]
ENCODINGS = [(Ros(), "ros2msg"), (Ros(), "ros2idl"), (Ros(is_ros1=True), "ros1msg")]


@pytest.mark.parametrize("schema", WRONG)
@pytest.mark.parametrize(("ros", "encoding"), ENCODINGS, ids=lambda value: str(value)[:20])
def test_a_wrong_schema(schema, ros, encoding, tmp_path):
    path = tmp_path / "log"
    messages = messages_of(SCANS, ros)
    path.write_bytes(ros_mcap(messages, ros, encoding=encoding, schemas={SCAN: schema}))
    found, report = try_to_read(path)
    assert report is None or len(found) == 80


@pytest.mark.parametrize("kind", ["bag", "lone db3"])
def test_a_definition_overwritten(kind, whole, tmp_path):
    """The definition beside the messages is no definition, or one of something else."""
    path = tmp_path / "log"
    for word in (b"float32 angle_min", b"float32[] ranges", b"std_msgs/Header header"):
        data = whole(kind)
        assert word in data
        for wrong in (b"x" * len(word), b"string[] " + b"y" * (len(word) - 9), bytes(len(word))):
            path.write_bytes(data.replace(word, wrong))
            found, report = try_to_read(path)
            assert report is None or len(found) == 80


def test_bad_lines_are_skipped_and_counted(tmp_path):
    path = tmp_path / "log"
    for data, bad in (
        (carmen(SCANS), b"FLASER 4 1 2 3\nFLASER x\nFLASER -3 1 2 3 4 5 6 7 8 9 10 11 12\n"),
        (csv(SCANS), b"1.5,no,number\n,,,,,,,\n" + b"nan," * 70 + b"\n"),
    ):
        lines = data.splitlines(keepends=True)
        path.write_bytes(b"".join([*lines[:30], bad, *lines[30:]]))
        found, report = read(path)
        assert len(found) == 80
        assert report.scans_skipped == 3
        assert any("skipped" in warning for warning in report.warnings)


@pytest.mark.parametrize(
    "data",
    [b"", b"\x89PNG\r\n\x1a\n" + bytes(99), b"hello, world\n" * 9, bytes(999), b"\x1f\x8b", b"a"],
)
def test_what_is_no_log_is_refused(data, tmp_path):
    path = tmp_path / "log"
    path.write_bytes(data)
    with pytest.raises(BsmapError):
        read(path)


def test_missing_files_and_empty_folders(tmp_path):
    for path in (tmp_path / "nowhere.bag", tmp_path):
        with pytest.raises(BsmapError, match=str(tmp_path)):
            read(path)


def test_random_bytes_behind_each_magic(tmp_path):
    rng = np.random.default_rng(3)
    path = tmp_path / "log"
    for magic in (
        b"\x89MCAP0\r\n",
        b"#ROSBAG V2.0\n",
        b"SQLite format 3\0",
        b"FLASER 3 ",
        b"t,r0,r1\n",
    ):
        for _ in range(30):
            path.write_bytes(magic + rng.bytes(2000))
            try_to_read(path)
