"""Small files that claim to be huge, read under a limit of memory that counts every library."""

import contextlib
import gzip
import resource
import struct
from pathlib import Path

import pytest

from bsmap_cli.errors import BsmapError
from bsmap_cli.logs.decoding import decoder_for
from bsmap_cli.logs.messages import BadMessageError, Channel
from tests.logs.making import (
    MAKERS,
    SCAN,
    Ros,
    field,
    messages_of,
    pack,
    read,
    ros_mcap,
    schema_of,
    some_scans,
    varint,
)

SCANS = some_scans(4, 31)
HUGE = 0xFFFFFFF0
ROOM_BYTES = 256 << 20  # a window of zstd may take half of it


@contextlib.contextmanager
def bounded_memory():
    """Allocations of more than `ROOM_BYTES` fail, in whatever library they are asked for."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    limit = pages * resource.getpagesize() + ROOM_BYTES
    resource.setrlimit(resource.RLIMIT_AS, (limit, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def cdr_of_four_gigabytes():
    """A CDR LaserScan whose ranges claim to be that many, at every place of a length."""
    payload = Ros().bytes_of(Ros().scan(SCANS[0]), SCAN)
    count = struct.pack("<I", len(SCANS[0].ranges_m))
    return payload.replace(count, struct.pack("<I", HUGE))


def cloud():
    """A cloud of four thousand million points in no bytes."""
    ros = Ros()
    fields = [
        ros.PointField(name=n, offset=4 * i, datatype=7, count=1) for i, n in enumerate("xyz")
    ]
    message = ros.PointCloud2(
        header=ros.header(SCANS[0].stamp_ns, "laser"),
        height=0xFFFF,
        width=0xFFFF,
        fields=fields,
        is_bigendian=False,
        point_step=12,
        row_step=12 * 0xFFFF,
        data=SCANS[0].ranges_m.view("u1")[:12],
        is_dense=False,
    )
    return ros.bytes_of(message, "sensor_msgs/msg/PointCloud2")


def channel(type_name, encoding="cdr"):
    kind, schema = schema_of(type_name, "ros2msg", False) if encoding == "cdr" else ("", b"")
    return Channel(
        topic="/x", type=type_name, encoding=encoding, schema_encoding=kind, schema=schema
    )


PAYLOADS = {
    "cdr": (channel(SCAN), cdr_of_four_gigabytes),
    "cloud": (channel("sensor_msgs/msg/PointCloud2"), cloud),
    "protobuf": (
        channel("foxglove.LaserScan", "protobuf"),
        lambda: field(2, "laser") + varint(6 << 3 | 2) + varint(HUGE) + bytes(64),
    ),
}


@pytest.mark.parametrize("kind", PAYLOADS)
def test_messages(kind):
    made, payload = PAYLOADS[kind]
    decode = decoder_for(made, last_echo=False)
    with bounded_memory(), contextlib.suppress(BadMessageError):
        decode(payload())


def lines(text):
    return (text * 3).encode()


def page_count(data):
    """A database that claims to have four thousand million pages."""
    return data[:28] + struct.pack(">I", HUGE) + data[32:]


def zstd_frame_of_four_gigabytes():
    """A frame header with that content size and the widest window, and one small block."""
    head = b"\x28\xb5\x2f\xfd" + bytes([0b10000000]) + bytes([0b10101000]) + struct.pack("<I", HUGE)
    return head + struct.pack("<I", (5 << 3) | 1)[:3] + b"hello"


def wrapped(chunk_compression, size_bytes, data):
    """An MCAP file of one chunk."""
    name = chunk_compression.encode()
    chunk = struct.pack("<QQQII", 0, 1, size_bytes, 0, len(name)) + name
    chunk += struct.pack("<Q", HUGE) + data
    return b"\x89MCAP0\r\n" + struct.pack("<BQ", 6, len(chunk)) + chunk


FILES = {
    "flaser": lambda folder: lines(f"FLASER {HUGE} 1 2 3 0 0 0 0 0 0 1.5 host 1\n"),
    "robotlaser": lambda folder: lines(f"ROBOTLASER1 0 0 3 1 9 0 0 {HUGE} 1 2 3 0 0 1 1 1 1 h 1\n"),
    "csv": lambda folder: f"t,angle_min,angle_increment,r0,r{HUGE}\n1,0,1,2,3\n".encode(),
    "csv numbers": lambda folder: b"t,angle_min,angle_increment,r0,r1\n1e999999999,0,1,2,3\n" * 3,
    "database": lambda folder: page_count(MAKERS["lone db3"](folder / "log", SCANS).read_bytes()),
    "gzip": lambda folder: gzip.compress(bytes(1000))[:-4] + struct.pack("<I", HUGE),
    "zstd": lambda folder: zstd_frame_of_four_gigabytes(),
    "zstd of zstd": lambda folder: pack(pack(bytes(10**7), ".zst"), ".zst"),
    "mcap record": lambda folder: b"\x89MCAP0\r\n" + struct.pack("<BQ", 1, HUGE) + bytes(900),
    "mcap zstd chunk": lambda folder: wrapped("zstd", HUGE, zstd_frame_of_four_gigabytes()),
    "mcap lz4 chunk": lambda folder: wrapped("lz4", 1 << 20, b"\x04\x22\x4d\x18" + bytes(900)),
    "mcap schema": lambda folder: ros_mcap(
        messages_of(SCANS, Ros()), Ros(), schemas={SCAN: b"float32[4294967280] ranges\n"}
    ),
    "bag": lambda folder: b"#ROSBAG V2.0\n" + struct.pack("<I", HUGE) + bytes(900),
    "bag data": lambda folder: b"#ROSBAG V2.0\n" + struct.pack("<II", 0, HUGE) + bytes(900),
}


@pytest.mark.parametrize("kind", FILES)
def test_files(kind, tmp_path):
    data = FILES[kind](tmp_path)
    path = tmp_path / "claims"
    path.write_bytes(data)
    assert len(data) < 100_000
    with bounded_memory(), contextlib.suppress(BsmapError):
        read(path)


def test_the_limit_counts():
    with bounded_memory(), pytest.raises(MemoryError):
        bytearray(2 * ROOM_BYTES)
