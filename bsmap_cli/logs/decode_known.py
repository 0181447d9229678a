"""`LaserScan` and `Odometry` in their usual definitions, straight from their bytes.

Several times as fast as a general decoder; for CDR in both byte orders and for ROS 1.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bsmap_cli.logs.canonical import yaw_of_quaternion
from bsmap_cli.logs.decoding import Decoder
from bsmap_cli.logs.messages import (
    SECOND_NS,
    BadMessageError,
    LaserRecord,
    OdometryRecord,
    plain_frame,
)

LASER_SCAN_TYPES = (
    "sensor_msgs/msg/LaserScan",
    "std_msgs/msg/Header",
    "builtin_interfaces/msg/Time",
)
ODOMETRY_TYPES = (
    "nav_msgs/msg/Odometry",
    "std_msgs/msg/Header",
    "builtin_interfaces/msg/Time",
    "geometry_msgs/msg/PoseWithCovariance",
    "geometry_msgs/msg/Pose",
    "geometry_msgs/msg/Point",
    "geometry_msgs/msg/Quaternion",
)
_NEXT = "=" * 80 + "\nMSG: "
_TEXTS = {
    LASER_SCAN_TYPES[0]: f"""
std_msgs/Header header
float32 angle_min
float32 angle_max
float32 angle_increment
float32 time_increment
float32 scan_time
float32 range_min
float32 range_max
float32[] ranges
float32[] intensities
{_NEXT}std_msgs/Header
""",
    ODOMETRY_TYPES[0]: f"""
std_msgs/Header header
string child_frame_id
geometry_msgs/PoseWithCovariance pose
geometry_msgs/TwistWithCovariance twist
{_NEXT}geometry_msgs/PoseWithCovariance
geometry_msgs/Pose pose
float64[36] covariance
{_NEXT}geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
{_NEXT}geometry_msgs/Point
float64 x
float64 y
float64 z
{_NEXT}geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
{_NEXT}std_msgs/Header
""",
}
_STAMP = "builtin_interfaces/Time stamp\nstring frame_id\n"
_BODY_START = 4
"""Behind the encapsulation of CDR, behind the sequence number of ROS 1."""


@dataclass(frozen=True, slots=True)
class _Layout:
    """How the parts of a message are packed; `align` is False in ROS 1."""

    head: struct.Struct
    scan: struct.Struct
    length: struct.Struct
    pose: struct.Struct
    values: np.dtype[np.float32]
    align: bool


def _layout(order: Literal["<", ">"], *, is_ros1: bool) -> _Layout:
    return _Layout(
        head=struct.Struct(f"{order}{'I' if is_ros1 else 'i'}II"),
        scan=struct.Struct(f"{order}7fI"),
        length=struct.Struct(f"{order}I"),
        pose=struct.Struct(f"{order}7d"),
        values=np.dtype(np.float32).newbyteorder(order),
        align=not is_ros1,
    )


_ROS1 = _layout("<", is_ros1=True)
_CDR = {1: _layout("<", is_ros1=False), 0: _layout(">", is_ros1=False)}
"""By the second byte of the encapsulation; the first is 0."""


def usual_definition(name: str, *, is_ros1: bool) -> str:
    """The first of `LASER_SCAN_TYPES` or `ODOMETRY_TYPES` as ROS defines it, with what it holds."""
    return _TEXTS[name] + ("uint32 seq\n" if is_ros1 else "") + _STAMP


def laser_scan_decoder(*, is_ros1: bool) -> Decoder:
    """A decoder of the payloads of one channel."""
    frames = _Frames()

    def decode(payload: bytes | memoryview) -> LaserRecord:
        layout = _ROS1 if is_ros1 else _cdr_layout(payload)
        try:
            seconds, nanoseconds, length = layout.head.unpack_from(payload, _BODY_START)
            name_start = _BODY_START + layout.head.size
            start = name_start + length
            if layout.align:
                start += -start % 4
            low, _, step, time_step, _, near, far, count = layout.scan.unpack_from(payload, start)
        except struct.error as error:
            raise BadMessageError("the message is cut off") from error
        start += layout.scan.size
        if start + 4 * count > len(payload):
            raise BadMessageError("the message claims more beams than it has")
        return LaserRecord(
            seconds * SECOND_NS + nanoseconds,
            frames.name(payload[name_start : name_start + length]),
            low,
            step,
            time_step,
            near,
            far,
            np.frombuffer(payload, layout.values, count, start).astype(np.float32),
        )

    return decode


def odometry_decoder(*, is_ros1: bool) -> Decoder:
    """A decoder of the payloads of one channel; covariances and speeds are passed over."""
    frames = _Frames()

    def decode(payload: bytes | memoryview) -> OdometryRecord:
        layout = _ROS1 if is_ros1 else _cdr_layout(payload)
        try:
            seconds, nanoseconds, length = layout.head.unpack_from(payload, _BODY_START)
            name_start = _BODY_START + layout.head.size
            name_end = name_start + length
            start = name_end + (-name_end % 4 if layout.align else 0)
            (child_length,) = layout.length.unpack_from(payload, start)
            child_start = start + layout.length.size
            start = child_end = child_start + child_length
            if layout.align:
                start += (_BODY_START - start) % 8
            x, y, _, qx, qy, qz, qw = layout.pose.unpack_from(payload, start)
        except struct.error as error:
            raise BadMessageError("the message is cut off") from error
        return OdometryRecord(
            seconds * SECOND_NS + nanoseconds,
            frames.name(payload[name_start:name_end]),
            frames.name(payload[child_start:child_end]),
            x,
            y,
            yaw_of_quaternion(qx, qy, qz, qw),
            bool(qx or qy or qz or qw),
        )

    return decode


def _cdr_layout(payload: bytes | memoryview) -> _Layout:
    layout = _CDR.get(payload[1]) if len(payload) > 1 and payload[0] == 0 else None
    if layout is None:
        raise BadMessageError(f"the encapsulation {payload[:2].hex()} is not plain CDR")
    return layout


class _Frames:
    """Names of frames, decoded once each."""

    def __init__(self) -> None:
        self._names: dict[bytes, str] = {}

    def name(self, text: bytes | memoryview) -> str:
        key = bytes(text)
        name = self._names.get(key)
        if name is None:
            name = plain_frame(key.rstrip(b"\0").decode("utf-8", "replace"))
            if len(self._names) < 1000:  # damaged messages must not fill the memory
                self._names[key] = name
        return name
