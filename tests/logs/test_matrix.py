"""One drive in every container, encoding and compression: the same scans, map and trajectory."""

import io
import struct
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from bsmap_cli.config import load_settings
from bsmap_cli.exchange.tum import write_tum
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import canonical_pose
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.mapping.map_file import write_map
from bsmap_cli.pipeline import run_slam
from bsmap_cli.sensor.simulator.simulation import simulate
from tests.cli.tool import bsmap, shell
from tests.logs.making import (
    LZ4,
    NONE,
    ZSTD,
    Ros,
    assert_same,
    carmen,
    csv,
    flaser,
    foxglove_mcap,
    messages_of,
    pack,
    read,
    robotlaser,
    ros2_folder,
    ros_bag,
    ros_mcap,
)

COUNT, PART = 200, 23
MOUNTING = canonical_pose(0.21, -0.03, 0.1)


def drive():
    """Half a turn wide, one degree a beam, nothing stated that a FLASER line cannot hold."""
    made = simulate("shapes", lidar="lms200", pose_base_laser=MOUNTING, seed=5)
    scans = []
    stamp_ns = 1_300_000_000_123_456_789
    for index, scan in zip(range(COUNT), made.scans(), strict=False):
        ranges = scan.ranges_m.copy()
        ranges[3 + index % 170] = [np.nan, np.inf, 0.0, -np.inf, 81.91][index % 5]
        changes = {"range_min_m": 0.0, "range_max_m": np.inf, "time_increment_s": 0.0}
        scans.append(replace(scan, stamp_ns=stamp_ns, ranges_m=ranges, topic="", **changes))
        stamp_ns += 100_000_001 if index % 50 != 20 else -30_000_007
    return scans


SCANS = drive()
ROS_ENCODINGS = {
    "ros2msg": (Ros(), "ros2msg"),
    "ros2idl": (Ros(), "ros2idl"),
    "big endian": (Ros(little_endian=False), "ros2msg"),
    "ros1msg": (Ros(is_ros1=True), "ros1msg"),
}
CHUNKS = {
    "unchunked": {"use_chunking": False},
    "plain chunks": {"compression": NONE},
    "lz4": {"compression": LZ4},
    "zstd": {"compression": ZSTD},
}
TEXTS = {
    "flaser": lambda scans: carmen(scans, flaser),
    "robotlaser": lambda scans: carmen(scans, robotlaser),
    "csv": csv,
    "csv seconds": lambda scans: csv(scans, seconds_column=True),
}


def mcap(scans, encoding, chunks):
    if encoding in ROS_ENCODINGS:
        ros, schemas = ROS_ENCODINGS[encoding]
        return ros_mcap(messages_of(scans, ros), ros, encoding=schemas, **CHUNKS[chunks])
    return foxglove_mcap(scans, encoding, **CHUNKS[chunks])


def in_parts(scans):
    return [scans[at : at + PART] for at in range(0, len(scans), PART)]


def written(path, data):
    path.write_bytes(data)
    return path


def files(folder, name, contents):
    """`name` holds a %d, counted without leading zeros: natural order is not that of the names."""
    return [written(folder / (name % index), data) for index, data in enumerate(contents)]


def bag1(folder, scans, compression):
    return ros_bag(folder / "run.bag", messages_of(scans, Ros(is_ros1=True)), compression)


def bag2(folder, storage, compression):
    return ros2_folder(folder / "run", messages_of(SCANS, Ros()), storage, compression)


def split_bag(folder, storage):
    """Parts of one bag; only the first tells where the laser sits, as recorders split."""
    ros, run = Ros(), folder / "run"
    messages = list(messages_of(SCANS, ros))
    pieces = [messages[:31], messages[31:300], messages[300:]]
    run.mkdir()
    for index, piece in enumerate(pieces):
        made = ros2_folder(folder / f"made_{index}", piece, storage)
        (part,) = (path for path in made.iterdir() if path.name != "metadata.yaml")
        part.rename(run / f"run_{index}{part.suffix}")
    names = "".join(f"    - run_{index}{part.suffix}\n" for index in range(len(pieces)))
    head = "rosbag2_bagfile_information:\n  version: 9\n  relative_file_paths:\n"
    (run / "metadata.yaml").write_text(head + names)
    return run


def lone_db3(folder):
    return next(bag2(folder, "sqlite3", None).glob("*.db3"))


MATRIX = {
    **{
        f"mcap {encoding} {chunks}": lambda folder, e=encoding, c=chunks: written(
            folder / "run.mcap", mcap(SCANS, e, c)
        )
        for encoding, chunks in product((*ROS_ENCODINGS, "json", "protobuf"), CHUNKS)
    },
    **{
        f"mcap {encoding} {suffix}": lambda folder, e=encoding, s=suffix: written(
            folder / f"run.mcap{s}", pack(mcap(SCANS, e, "plain chunks"), s)
        )
        for encoding, suffix in product(("ros2msg", "ros1msg", "protobuf"), (".gz", ".zst"))
    },
    **{
        f"bag {compression}": lambda folder, c=compression: bag1(folder, SCANS, c)
        for compression in (None, "bz2", "lz4")
    },
    **{
        f"ros2 {storage} {compression}": lambda folder, s=storage, c=compression: bag2(folder, s, c)
        for storage, compression in (
            ("mcap", None),
            ("sqlite3", None),
            ("sqlite3", "FILE"),
            ("sqlite3", "MESSAGE"),
        )
    },
    "ros2 mcap split": lambda folder: split_bag(folder, "mcap"),
    "ros2 sqlite3 split": lambda folder: split_bag(folder, "sqlite3"),
    "lone db3": lone_db3,
    **{
        f"{kind}{suffix}": lambda folder, k=kind, s=suffix: written(
            folder / f"run{s}", pack(TEXTS[k](SCANS), s) if s else TEXTS[k](SCANS)
        )
        for kind, suffix in product(TEXTS, ("", ".gz", ".zst"))
    },
    **{
        f"several {kind}": lambda folder, k=kind: files(
            folder, "part_%d", map(TEXTS[k], in_parts(SCANS))
        )
        for kind in TEXTS
    },
    "several .csv.gz": lambda folder: files(
        folder, "part_%d.csv.gz", [pack(csv(part), ".gz") for part in in_parts(SCANS)]
    ),
    "several mcap": lambda folder: files(
        folder, "part_%d.mcap", [mcap(part, "ros2msg", "zstd") for part in in_parts(SCANS)]
    ),
    "several bags": lambda folder: [
        bag1(made, part, "lz4").rename(folder / f"part_{index}.bag")
        for index, part in enumerate(in_parts(SCANS))
        if (made := folder / f"made_{index}").mkdir() is None
    ],
}
MAPPED = [
    "mcap ros2msg zstd",
    "mcap ros1msg unchunked",
    "mcap json lz4",
    "mcap protobuf .gz",
    "bag bz2",
    "ros2 sqlite3 split",
    "flaser.zst",
    "several csv seconds",
]


@pytest.mark.parametrize("kind", MATRIX)
def test_every_container_gives_the_same_scans(kind, tmp_path):
    found, report = read(MATRIX[kind](tmp_path))
    assert_same(found, SCANS)
    assert {scan.pose_base_laser for scan in found} == {MOUNTING}
    assert (report.scans_read, report.scans_skipped, report.truncated) == (COUNT, 0, False)
    assert report.warnings == []


def test_the_drive_has_what_makes_containers_differ():
    steps_ns = np.diff([scan.stamp_ns for scan in SCANS])
    assert len(SCANS) == COUNT
    assert (steps_ns < 0).sum() == 4
    assert all(float(scan.stamp_ns) / 1e9 * 1e9 != scan.stamp_ns for scan in SCANS[:3])
    assert all(scan.pose_odom_base != SE2.identity() for scan in SCANS[5:])


def chunks_of(data):
    """What a map is made of, read by hand: the payloads of all levels and of the path."""
    at, parts = 8, []
    while at < len(data):
        (length,) = struct.unpack_from("<I", data, at)
        kind, payload = data[at + 4 : at + 8], data[at + 8 : at + 8 + length]
        if kind in (b"LEVL", b"path"):
            parts.append((kind, payload))
        at += 12 + length
    return parts


def mapped(source):
    """The parts of the map and the trajectory, as files would hold them."""
    with open_log(source if isinstance(source, list) else [source], ReadOptions()) as reader:
        run = run_slam(reader, load_settings())
    data, lines = io.BytesIO(), io.StringIO()
    write_map(data, run.document)
    write_tum(lines, run.trajectory)
    return chunks_of(data.getvalue()), lines.getvalue().encode()


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """Map and trajectory of one container."""
    made = mapped(MATRIX[MAPPED[0]](tmp_path_factory.mktemp("reference")))
    (kind, level), *rest = made[0]
    assert (kind, [name for name, _ in rest]) == (b"LEVL", [b"path"])
    assert len(level) > 500
    assert made[1].count(b"\n") == COUNT
    return made


@pytest.mark.parametrize("kind", MAPPED[1:])
def test_every_family_gives_the_same_map_and_trajectory(kind, reference, tmp_path):
    assert mapped(MATRIX[kind](tmp_path)) == reference


def test_the_stamps_of_the_trajectory_are_those_of_the_scans_to_the_nanosecond(reference):
    stamps = [line.split()[0].replace(b".", b"") for line in reference[1].splitlines()]
    assert [int(stamp) for stamp in stamps] == [scan.stamp_ns for scan in SCANS]


@pytest.mark.parametrize(
    ("kind", "line"),
    [
        ("mcap ros2idl zstd", "cat run.mcap | bsmap slam - -o m.bsm --traj t.tum"),
        ("several mcap", "bsmap slam part_*.mcap -o m.bsm --traj t.tum"),
        ("robotlaser.gz", "zcat run.gz | bsmap slam - -o - --traj t.tum > m.bsm"),
        (
            "ros2 mcap None",
            "bsmap scans run -o - --format csv | bsmap slam -o m.bsm --traj t.tum",
        ),
    ],
)
def test_the_installed_command_gives_the_same_map_and_trajectory(kind, line, reference, tmp_path):
    MATRIX[kind](tmp_path)
    ran = shell(line, tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert chunks_of((tmp_path / "m.bsm").read_bytes()) == reference[0]
    assert (tmp_path / "t.tum").read_bytes() == reference[1]


@pytest.mark.parametrize("form", ["run.mcap", "run.bag", "run.csv"])
def test_what_scans_writes_gives_the_same_map_and_trajectory(form, reference, tmp_path):
    MATRIX["flaser"](tmp_path)
    ran = bsmap("scans", "run", "-o", form, "-q", cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert mapped(tmp_path / form) == reference
