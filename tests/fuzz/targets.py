"""What is fuzzed: a reader that takes bytes, what it may refuse with, and files to start from."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bsmap_cli.errors import BsmapError, MapFileError
from bsmap_cli.exchange.map_json import read_map_json, write_map_json
from bsmap_cli.exchange.tum import read_tum
from bsmap_cli.logs.decoding import decoder_for
from bsmap_cli.logs.messages import BadMessageError, Channel
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.mapping.map_file import read_map
from tests.logs.making import (
    MAKERS,
    ODOM,
    SCAN,
    TF,
    Ros,
    field,
    json_scan,
    planar,
    schema_of,
    some_scans,
)

GOLDEN = Path(__file__).parent.parent / "mapping" / "golden"
SCANS = some_scans(6, 9)


@dataclass(frozen=True)
class Target:
    """`read` returns or raises one of `refusals`; anything else is a fault."""

    read: Callable[[bytes], object]
    refusals: tuple[type[Exception], ...]
    seeds: tuple[bytes, ...]


def read_log(data: bytes) -> None:
    """Every promise that a reader of logs makes of the scans it hands out."""
    with open_log([io.BytesIO(data)], ReadOptions()) as reader:
        count = 0
        for scan in reader.scans():
            count += 1
            assert scan.ranges_m.dtype == np.float32
            assert len(scan.ranges_m) > 1
            assert scan.angle_increment_rad > 0.0
            assert np.isfinite(scan.angle_min_rad)
            assert abs(scan.stamp_ns) < 2**63
            if scan.pose_odom_base is not None:
                assert np.isfinite(scan.pose_odom_base.as_array()).all()
        assert count == reader.report.scans_read


def log_target(*kinds: str) -> Target:
    return Target(read_log, (BsmapError,), tuple(made(kind) for kind in kinds))


def made(kind: str) -> bytes:
    """A log of a few scans."""
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        return MAKERS[kind](Path(folder) / "log", SCANS).read_bytes()


def decoder_target(encoding: str, *messages: tuple[str, bytes]) -> Target:
    """The first byte chooses the type, the rest is the payload."""
    decoders = []
    for type_name, _ in messages:
        kind, schema = ("", b"")
        if encoding in ("cdr", "ros1"):
            kind, schema = schema_of(type_name, "ros2msg", encoding == "ros1")
        channel = Channel(
            topic="/x", type=type_name, encoding=encoding, schema_encoding=kind, schema=schema
        )
        decoders.append(decoder_for(channel, last_echo=False))

    def read(data: bytes) -> None:
        if data:
            decoders[data[0] % len(decoders)](data[1:])

    seeds = tuple(bytes([index]) + payload for index, (_, payload) in enumerate(messages))
    return Target(read, (BadMessageError,), seeds)


def ros_target(*, is_ros1: bool) -> Target:
    ros, pose = Ros(is_ros1=is_ros1), SCANS[1].pose_odom_base
    stamp = SCANS[0].stamp_ns
    messages = {
        SCAN: ros.scan(SCANS[0]),
        ODOM: ros.odometry(stamp, pose),
        TF: ros.transforms(planar(stamp, "a", "b", pose)),
    }
    encoded = ((name, ros.bytes_of(message, name)) for name, message in messages.items())
    return decoder_target("ros1" if is_ros1 else "cdr", *encoded)


def foxglove_target() -> Target:
    scan = field(2, "laser") + field(4, -1.0) + field(5, 1.0) + field(6, np.arange(9.0).tobytes())
    return decoder_target("protobuf", ("foxglove.LaserScan", scan))


def maps() -> tuple[bytes, ...]:
    return tuple(path.read_bytes() for path in sorted(GOLDEN.glob("*.bsm")))


def twin_of(data: bytes) -> bytes:
    stream = io.BytesIO()
    write_map_json(stream, read_map(io.BytesIO(data)))
    return stream.getvalue()


TARGETS: dict[str, Callable[[], Target]] = {
    "bsm": lambda: Target(lambda d: read_map(io.BytesIO(d)), (MapFileError,), maps()),
    "csv": lambda: log_target("csv", "csv seconds"),
    "carmen": lambda: log_target("carmen flaser", "carmen robotlaser", "carmen rawlaser"),
    "cdr": lambda: ros_target(is_ros1=False),
    "ros1": lambda: ros_target(is_ros1=True),
    "protobuf": foxglove_target,
    "json": lambda: decoder_target("json", ("foxglove.LaserScan", json_scan(SCANS[0]))),
    "mcap": lambda: log_target("mcap zstd", "mcap no chunks", "mcap json"),
    "bag": lambda: log_target("bag", "bag lz4"),
    "packed": lambda: log_target("csv.gz", "carmen.zst"),
    "twin": lambda: Target(
        lambda d: read_map_json(io.BytesIO(d)), (MapFileError,), tuple(map(twin_of, maps()))
    ),
    "tum": lambda: Target(
        lambda d: read_tum(io.StringIO(d.decode("utf-8", "replace"))),
        (BsmapError,),
        (b"1300000000.123456789 1 2 0 0 0 0.1 0.9\n# end\n",),
    ),
}
