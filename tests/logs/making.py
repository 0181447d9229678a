"""Logs of every kind, made of the same scans by other means than the product's writers."""

from __future__ import annotations

import gzip
import io
import json
import math
import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zstandard
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import canonical_yaw
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.sensor.scan import Scan

SECOND_NS = 1_000_000_000
TIME, HEADER = "builtin_interfaces/msg/Time", "std_msgs/msg/Header"
SCAN, ODOM, TF = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"

ROS2 = get_typestore(Stores.ROS2_HUMBLE)
ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))


def float32(value: float) -> float:
    return float(np.float32(value))


def some_scans(count: int = 200, beams: int = 181, *, odometry: bool = True) -> list[Scan]:
    """Scans a half turn wide with awkward stamps and ranges, as a CARMEN log can hold them too."""
    rng = np.random.default_rng(7)
    scans = []
    stamp_ns = 1_300_000_000_000_000_001
    for index in range(count):
        ranges = rng.uniform(0.05, 29.0, beams).astype(np.float32)
        ranges[rng.integers(0, beams, 5)] = 81.91
        ranges[index % beams] = [np.nan, np.inf, 0.0, 1e-9][index % 4]
        pose = SE2.from_array((0.01 * index + 576.0, 0.3 - 0.002 * index, 0.0731 * index))
        scans.append(
            Scan(
                stamp_ns=stamp_ns,
                ranges_m=ranges,
                angle_min_rad=float32(-math.pi / 2),
                angle_increment_rad=float32(math.pi / (beams - 1)),
                pose_odom_base=pose if odometry else None,
            )
        )
        stamp_ns += int(rng.integers(20_000_000, 90_000_000)) if index % 17 else -3_000_001
    return scans


def read(source, **options) -> tuple[list[Scan], object]:
    sources = source if isinstance(source, list) else [source]
    with open_log(sources, ReadOptions(**options)) as reader:
        return list(reader.scans()), reader.report


def assert_same(found: list[Scan], expected: list[Scan], *, odometry: bool = True) -> None:
    """Equal to the bit in all that a map is made of."""
    assert len(found) == len(expected)
    for a, b in zip(found, expected, strict=True):
        assert a.stamp_ns == b.stamp_ns
        assert a.ranges_m.dtype == np.float32
        np.testing.assert_array_equal(a.ranges_m, b.ranges_m)
        assert a.angle_min_rad == b.angle_min_rad
        assert a.angle_increment_rad == b.angle_increment_rad
        assert a.time_increment_s == b.time_increment_s
        assert (a.range_min_m, a.range_max_m) == (b.range_min_m, b.range_max_m)
        if odometry and b.pose_odom_base is not None:
            pose = b.pose_odom_base
            assert a.pose_odom_base == SE2(pose.x, pose.y, canonical_yaw(pose.theta))
        else:
            assert a.pose_odom_base is None


# --- ROS messages -----------------------------------------------------------------------------


@dataclass
class Ros:
    """Messages and their bytes, of ROS 1 or 2."""

    is_ros1: bool = False
    little_endian: bool = True

    @property
    def store(self):
        return ROS1 if self.is_ros1 else ROS2

    def __getattr__(self, name):
        def find(**fields):
            found = [t for t in self.store.types if t.endswith(f"/{name}")]
            return self.store.types[found[0]](**fields)

        return find

    def bytes_of(self, message, type_name) -> bytes:
        """The message as it travels; bytes are passed on, as a broken driver would."""
        if isinstance(message, bytes):
            return message
        if self.is_ros1:
            return bytes(ROS1.serialize_ros1(message, type_name))
        return bytes(ROS2.serialize_cdr(message, type_name, little_endian=self.little_endian))

    def header(self, stamp_ns, frame):
        time = self.Time(sec=stamp_ns // SECOND_NS, nanosec=stamp_ns % SECOND_NS)
        return self.Header(stamp=time, frame_id=frame, **({"seq": 3} if self.is_ros1 else {}))

    def scan(self, scan: Scan, frame="laser", stamp_ns=None, **changes):
        fields = {
            "header": self.header(scan.stamp_ns if stamp_ns is None else stamp_ns, frame),
            "angle_min": scan.angle_min_rad,
            "angle_max": 99.0,  # nothing may be made of it
            "angle_increment": scan.angle_increment_rad,
            "time_increment": scan.time_increment_s,
            "scan_time": 0.1,
            "range_min": scan.range_min_m,
            "range_max": scan.range_max_m,
            "ranges": scan.ranges_m,
            "intensities": np.ones(len(scan.ranges_m), np.float32),
        }
        return self.LaserScan(**(fields | changes))

    def quaternion(self, yaw):
        return self.Quaternion(x=0.0, y=0.0, z=math.sin(yaw / 2), w=math.cos(yaw / 2))

    def odometry(self, stamp_ns, pose: SE2, frame="odom", child="base_link", quaternion=None):
        zero = self.Vector3(x=0.0, y=0.0, z=0.0)
        covariance = np.zeros(36)
        return self.Odometry(
            header=self.header(stamp_ns, frame),
            child_frame_id=child,
            pose=self.PoseWithCovariance(
                pose=self.Pose(
                    position=self.Point(x=pose.x, y=pose.y, z=0.0),
                    orientation=quaternion or self.quaternion(pose.theta),
                ),
                covariance=covariance,
            ),
            twist=self.TwistWithCovariance(
                twist=self.Twist(linear=zero, angular=zero), covariance=covariance
            ),
        )

    def transforms(self, *transforms):
        """From (stamp_ns, parent, child, (x, y, z), (qx, qy, qz, qw))."""
        return self.TFMessage(
            transforms=[
                self.TransformStamped(
                    header=self.header(stamp_ns, parent),
                    child_frame_id=child,
                    transform=self.Transform(
                        translation=self.Vector3(x=t[0], y=t[1], z=t[2]),
                        rotation=self.Quaternion(x=q[0], y=q[1], z=q[2], w=q[3]),
                    ),
                )
                for stamp_ns, parent, child, t, q in transforms
            ]
        )


def planar(stamp_ns, parent, child, pose: SE2):
    """A transform as `Ros.transforms` takes it."""
    half = pose.theta / 2
    return (
        stamp_ns,
        parent,
        child,
        (pose.x, pose.y, 0.0),
        (0.0, 0.0, math.sin(half), math.cos(half)),
    )


def messages_of(scans, ros: Ros):
    """(topic, type, log time, message): a level mounting, odometry, then the scan."""
    first = scans[0].stamp_ns
    static = ros.transforms(planar(first, "base_link", "laser", scans[0].pose_base_laser))
    yield "/tf_static", TF, first, static
    for scan in scans:
        if scan.pose_odom_base is not None:
            yield "/odom", ODOM, scan.stamp_ns, ros.odometry(scan.stamp_ns, scan.pose_odom_base)
        yield "/scan", SCAN, scan.stamp_ns, ros.scan(scan)


# --- containers of messages -------------------------------------------------------------------

IDL = {
    SCAN: "=" * 80
    + """
IDL: sensor_msgs/msg/LaserScan
#include "std_msgs/msg/Header.idl"
module sensor_msgs { module msg { struct LaserScan {
  std_msgs::msg::Header header;
  float angle_min; float angle_max; float angle_increment; float time_increment;
  float scan_time; float range_min; float range_max;
  sequence<float> ranges; sequence<float> intensities;
}; }; };
"""
    + "=" * 80
    + """
IDL: std_msgs/msg/Header
#include "builtin_interfaces/msg/Time.idl"
module std_msgs { module msg { struct Header {
  builtin_interfaces::msg::Time stamp; string frame_id;
}; }; };
"""
    + "=" * 80
    + """
IDL: builtin_interfaces/msg/Time
module builtin_interfaces { module msg { struct Time { long sec; unsigned long nanosec; }; }; };
""",
}


def schema_of(type_name: str, encoding: str, is_ros1: bool) -> tuple[str, bytes]:
    if encoding == "ros2idl" and type_name in IDL:
        return "ros2idl", IDL[type_name].encode()
    if is_ros1:
        return "ros1msg", ROS1.generate_msgdef(type_name, ros_version=1)[0].encode()
    return "ros2msg", ROS2.generate_msgdef(type_name, ros_version=2)[0].encode()


def ros_mcap(messages, ros: Ros, *, encoding="ros2msg", schemas=None, **writer) -> bytes:
    """schemas : type to bytes, where the usual ones are to be replaced."""
    stream = io.BytesIO()
    mcap = McapWriter(stream, **{"chunk_size": 20_000, "enable_data_crcs": True, **writer})
    mcap.start(profile="ros1" if ros.is_ros1 else "ros2", library="test")
    channels = {}
    for topic, type_name, log_time_ns, message in messages:
        if topic not in channels:
            schema_encoding, schema = schema_of(type_name, encoding, ros.is_ros1)
            schema = (schemas or {}).get(type_name, schema)
            name = type_name.replace("/msg/", "/") if ros.is_ros1 else type_name
            channels[topic] = mcap.register_channel(
                topic,
                "ros1" if ros.is_ros1 else "cdr",
                mcap.register_schema(name, schema_encoding, schema),
            )
        data = ros.bytes_of(message, type_name)
        mcap.add_message(channels[topic], log_time_ns, data, log_time_ns)
    mcap.finish()
    return stream.getvalue()


def ros_bag(path: Path, messages, compression=None) -> Path:
    writer = Bag1Writer(path)
    writer.chunk_threshold = 20_000
    if compression:
        writer.set_compression(getattr(Bag1Writer.CompressionFormat, compression.upper()))
    ros = Ros(is_ros1=True)
    with writer:
        connections = {}
        for topic, type_name, log_time_ns, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, type_name, typestore=ROS1)
            writer.write(connections[topic], log_time_ns, ros.bytes_of(message, type_name))
    return path


def ros2_folder(path: Path, messages, storage="sqlite3", compression=None) -> Path:
    writer = Bag2Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()])
    if compression:
        writer.set_compression(CompressionMode[compression], CompressionFormat.ZSTD)
    ros = Ros()
    with writer:
        connections = {}
        for topic, type_name, log_time_ns, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, type_name, typestore=ROS2)
            writer.write(connections[topic], log_time_ns, ros.bytes_of(message, type_name))
    return path


# --- foxglove ---------------------------------------------------------------------------------


def foxglove_mcap(scans, encoding: str, **writer) -> bytes:
    stream = io.BytesIO()
    mcap = McapWriter(stream, **{"chunk_size": 20_000, **writer})
    mcap.start(profile="", library="test")
    schema_encoding = {"json": "jsonschema", "protobuf": "protobuf"}[encoding]
    channels = {
        topic: mcap.register_channel(
            topic, encoding, mcap.register_schema(name, schema_encoding, b"{}")
        )
        for topic, name in (
            ("/scan", "foxglove.LaserScan"),
            ("/odom_pose", "foxglove.PoseInFrame"),
            ("/tf", "foxglove.FrameTransform"),
        )
    }
    make = _JSON if encoding == "json" else _PROTOBUF
    first = scans[0].stamp_ns
    transform = make["tf"](first, "base_link", "laser", scans[0].pose_base_laser)
    mcap.add_message(channels["/tf"], first, transform, first)
    for scan in scans:
        stamp = scan.stamp_ns
        if scan.pose_odom_base is not None:
            mcap.add_message(
                channels["/odom_pose"], stamp, make["pose"](stamp, scan.pose_odom_base), stamp
            )
        mcap.add_message(channels["/scan"], stamp, make["scan"](scan), stamp)
    mcap.finish()
    return stream.getvalue()


def _end_angle(scan: Scan) -> float:
    return scan.angle_min_rad + (len(scan.ranges_m) - 1) * scan.angle_increment_rad


def _json_stamp(stamp_ns):
    return {"sec": stamp_ns // SECOND_NS, "nsec": stamp_ns % SECOND_NS}


def _json_turn(yaw):
    return {"x": 0, "y": 0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}


def _json_pose(pose: SE2):
    return {
        "position": {"x": pose.x, "y": pose.y, "z": 0},
        "orientation": _json_turn(pose.theta),
    }


def json_scan(scan: Scan, **changes) -> bytes:
    ranges = [None if math.isnan(v) else v for v in scan.ranges_m.tolist()]
    message = {
        "timestamp": _json_stamp(scan.stamp_ns),
        "frame_id": "laser",
        "pose": _json_pose(SE2.identity()),
        "start_angle": scan.angle_min_rad,
        "end_angle": _end_angle(scan),
        "ranges": ranges,
        "intensities": [],
    }
    return json.dumps(message | changes).encode()


_JSON = {
    "scan": json_scan,
    "pose": lambda stamp, pose: json.dumps(
        {"timestamp": _json_stamp(stamp), "frame_id": "odom", "pose": _json_pose(pose)}
    ).encode(),
    "tf": lambda stamp, parent, child, pose: json.dumps(
        {
            "timestamp": _json_stamp(stamp),
            "parent_frame_id": parent,
            "child_frame_id": child,
            "translation": {"x": pose.x, "y": pose.y, "z": 0},
            "rotation": _json_turn(pose.theta),
        }
    ).encode(),
}


def varint(value: int) -> bytes:
    out = b""
    while value > 0x7F:
        out += bytes([value & 0x7F | 0x80])
        value >>= 7
    return out + bytes([value])


def field(number: int, value) -> bytes:
    if isinstance(value, float):
        return varint(number << 3 | 1) + struct.pack("<d", value)
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    value = value.encode() if isinstance(value, str) else value
    return varint(number << 3 | 2) + varint(len(value)) + value


def _pb_stamp(stamp_ns):
    return field(1, field(1, stamp_ns // SECOND_NS) + field(2, stamp_ns % SECOND_NS))


def _pb_vector(*values):
    return b"".join(field(i + 1, float(v)) for i, v in enumerate(values) if v)


def _pb_turn(yaw):
    return _pb_vector(0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))


def _pb_pose(pose: SE2):
    return field(1, _pb_vector(pose.x, pose.y)) + field(2, _pb_turn(pose.theta))


_PROTOBUF = {
    "scan": lambda scan: (
        _pb_stamp(scan.stamp_ns)
        + field(2, "laser")
        + field(3, _pb_pose(SE2.identity()))
        + field(4, scan.angle_min_rad)
        + field(5, _end_angle(scan))
        + field(6, scan.ranges_m.astype("<f8").tobytes())
    ),
    "pose": lambda stamp, pose: _pb_stamp(stamp) + field(2, "odom") + field(3, _pb_pose(pose)),
    "tf": lambda stamp, parent, child, pose: (
        _pb_stamp(stamp)
        + field(2, parent)
        + field(3, child)
        + field(4, _pb_vector(pose.x, pose.y))
        + field(5, _pb_turn(pose.theta))
    ),
}


# --- text -------------------------------------------------------------------------------------


def seconds(stamp_ns: int) -> str:
    return f"{stamp_ns // SECOND_NS}.{stamp_ns % SECOND_NS:09d}"


def numbers(values) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def flaser(scan: Scan, laser: SE2 | None = None) -> str:
    pose = scan.pose_odom_base or SE2.identity()
    first = pose @ (laser or scan.pose_base_laser)
    poses = f"{first.x!r} {first.y!r} {first.theta!r} {pose.x!r} {pose.y!r} {pose.theta!r}"
    ranges = scan.ranges_m.tolist()
    return f"FLASER {len(ranges)} {numbers(ranges)} {poses} {seconds(scan.stamp_ns)} host 0.5\n"


def robotlaser(scan: Scan, laser: SE2 | None = None, remissions=(), farthest=0.0) -> str:
    pose = scan.pose_odom_base or SE2.identity()
    first = pose @ (laser or scan.pose_base_laser)
    poses = f"{first.x!r} {first.y!r} {first.theta!r} {pose.x!r} {pose.y!r} {pose.theta!r}"
    ranges = scan.ranges_m.tolist()
    return (
        f"ROBOTLASER1 0 {scan.angle_min_rad!r} {math.pi!r} {scan.angle_increment_rad!r} {farthest}"
        f" 0.01 0 {len(ranges)} {numbers(ranges)} {len(remissions)} {numbers(remissions)}"
        f"{' ' if remissions else ''}{poses} 0.1 0.2 0.3 0.4 0.5"
        f" {seconds(scan.stamp_ns)} host 0.5\n"
    )


def rawlaser(scan: Scan) -> str:
    ranges = scan.ranges_m.tolist()
    return (
        f"RAWLASER1 0 {scan.angle_min_rad!r} {math.pi!r} {scan.angle_increment_rad!r} 0 0.01 0"
        f" {len(ranges)} {numbers(ranges)} 0 {seconds(scan.stamp_ns)} host 0.5\n"
    )


def odom(stamp_ns: int, pose: SE2) -> str:
    numbers = f"{pose.x!r} {pose.y!r} {pose.theta!r}"
    return f"ODOM {numbers} 0.1 0.2 0 {seconds(stamp_ns)} host 0.1\n"


def raw_carmen(scans) -> bytes:
    """Raw lines have no pose: it stands in a line of its own, before or after the scan."""
    parts = ["PARAM robot_frontlaser_offset 0.0 1.5 host 0.5\n"]
    for index, scan in enumerate(scans):
        pair = [rawlaser(scan)]
        if scan.pose_odom_base is not None:
            pair.insert(index % 2, odom(scan.stamp_ns, scan.pose_odom_base))
        parts += pair
    return "".join(parts).encode()


def carmen(scans, line=flaser) -> bytes:
    head = "# a comment\nPARAM robot_frontlaser_offset 0.0 x 0 y 0\nSYNC a b\n"
    odom = "ODOM 1 2 3 0.1 0.2 0 1300000000.5 host 0.1\n"
    return (head + "".join(line(scan) + odom for scan in scans)).encode()


def csv(scans, *, seconds_column=False) -> bytes:
    beams = len(scans[0].ranges_m)
    is_placed = any(scan.pose_base_laser != SE2.identity() for scan in scans)
    rows = [
        "# made by hand\n"
        + ("t" if seconds_column else "stamp_ns")
        + ",y,x,theta,angle_increment,angle_min,"
        + ("laser_theta,laser_x,laser_y," if is_placed else "")
        + ",".join(f"r{i}" for i in range(beams))
    ]
    for scan in scans:
        pose = scan.pose_odom_base
        stamp = seconds(scan.stamp_ns) if seconds_column else str(scan.stamp_ns)
        place = [""] * 3 if pose is None else [repr(pose.y), repr(pose.x), repr(pose.theta)]
        angles = [repr(scan.angle_increment_rad), repr(scan.angle_min_rad)]
        laser = scan.pose_base_laser
        mounting = [repr(laser.theta), repr(laser.x), repr(laser.y)] if is_placed else []
        ranges = ["" if math.isnan(v) else f"{v:.9g}" for v in scan.ranges_m.tolist()]
        rows.append(",".join([stamp, *place, *angles, *mounting, *ranges]))
    return ("\n".join(rows) + "\n").encode()


# --- all of them ------------------------------------------------------------------------------


def pack(data: bytes, suffix: str) -> bytes:
    if suffix == ".gz":
        return gzip.compress(data, mtime=0)
    return zstandard.ZstdCompressor(write_checksum=True).compress(data)


def _mcap(path: Path, scans, ros=None, **options) -> Path:
    ros = ros or Ros()
    path.write_bytes(ros_mcap(messages_of(scans, ros), ros, **options))
    return path


def _bytes(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def _db3(path: Path, scans) -> Path:
    folder = ros2_folder(path.with_name("folder"), messages_of(scans, Ros()))
    (found,) = folder.glob("*.db3")
    return found


NONE, LZ4, ZSTD = CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD
MAKERS = {
    "mcap zstd": lambda p, s: _mcap(p, s, compression=ZSTD),
    "mcap lz4": lambda p, s: _mcap(p, s, compression=LZ4),
    "mcap plain chunks": lambda p, s: _mcap(p, s, compression=NONE),
    "mcap no chunks": lambda p, s: _mcap(p, s, use_chunking=False),
    "mcap no summary": lambda p, s: _mcap(
        p, s, use_statistics=False, repeat_channels=False, use_summary_offsets=False
    ),
    "mcap idl": lambda p, s: _mcap(p, s, encoding="ros2idl"),
    "mcap big endian": lambda p, s: _mcap(p, s, ros=Ros(little_endian=False)),
    "mcap ros1": lambda p, s: _mcap(p, s, ros=Ros(is_ros1=True)),
    "mcap json": lambda p, s: _bytes(p, foxglove_mcap(s, "json")),
    "mcap protobuf": lambda p, s: _bytes(p, foxglove_mcap(s, "protobuf")),
    "mcap.gz": lambda p, s: _bytes(p, pack(_mcap(p, s).read_bytes(), ".gz")),
    "mcap.zst": lambda p, s: _bytes(p, pack(_mcap(p, s).read_bytes(), ".zst")),
    "bag": lambda p, s: ros_bag(p, messages_of(s, Ros(is_ros1=True))),
    "bag bz2": lambda p, s: ros_bag(p, messages_of(s, Ros(is_ros1=True)), "bz2"),
    "bag lz4": lambda p, s: ros_bag(p, messages_of(s, Ros(is_ros1=True)), "lz4"),
    "ros2 mcap": lambda p, s: ros2_folder(p, messages_of(s, Ros()), "mcap"),
    "ros2 sqlite": lambda p, s: ros2_folder(p, messages_of(s, Ros())),
    "ros2 sqlite file zstd": lambda p, s: ros2_folder(p, messages_of(s, Ros()), compression="FILE"),
    "ros2 sqlite message zstd": lambda p, s: ros2_folder(
        p, messages_of(s, Ros()), compression="MESSAGE"
    ),
    "lone db3": _db3,
    "carmen flaser": lambda p, s: _bytes(p, carmen(s)),
    "carmen robotlaser": lambda p, s: _bytes(p, carmen(s, robotlaser)),
    "carmen rawlaser": lambda p, s: _bytes(p, raw_carmen(s)),
    "carmen.gz": lambda p, s: _bytes(p, pack(carmen(s), ".gz")),
    "carmen.zst": lambda p, s: _bytes(p, pack(carmen(s), ".zst")),
    "csv": lambda p, s: _bytes(p, csv(s)),
    "csv seconds": lambda p, s: _bytes(p, csv(s, seconds_column=True)),
    "csv.gz": lambda p, s: _bytes(p, pack(csv(s), ".gz")),
    "csv.zst": lambda p, s: _bytes(p, pack(csv(s), ".zst")),
}
