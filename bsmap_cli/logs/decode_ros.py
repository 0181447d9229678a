"""ROS messages, CDR or ROS 1, decoded by the definition that travels in the log.

`LaserScan` and `Odometry` in their usual definitions have decoders of their own (`decode_known`);
everything else goes through a `rosbags` typestore.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from bsmap_cli.logs.byte_streams import ZSTD_MAGIC, DamagedBytesError
from bsmap_cli.logs.canonical import float32_ranges, yaw_of_quaternion
from bsmap_cli.logs.chunks import CHUNK_LIMIT_BYTES, unpack_chunk
from bsmap_cli.logs.decode_known import (
    LASER_SCAN_TYPES,
    ODOMETRY_TYPES,
    laser_scan_decoder,
    odometry_decoder,
    usual_definition,
)
from bsmap_cli.logs.decode_point_cloud import cloud_record
from bsmap_cli.logs.decoding import Decoder
from bsmap_cli.logs.messages import (
    SECOND_NS,
    BadMessageError,
    Channel,
    LaserRecord,
    OdometryRecord,
    Record,
    TransformRecord,
    plain_frame,
)
from bsmap_cli.sensor.scan import Ranges

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_SCHEMA_LIMIT_BYTES = 1 << 18
_IDL_SEPARATOR = "=" * 80 + "\n"


def ros_decoder(channel: Channel, *, last_echo: bool) -> Decoder:
    """A decoder for a channel of one of the types of `_RECORDS`.

    Messages that ROS 2 has packed one by one are unpacked: no CDR begins like a `.zst`.
    """
    decode = _plain_decoder(channel, last_echo=last_echo)

    def decode_packed(payload: bytes | memoryview) -> Record:
        if not payload or payload[0] != ZSTD_MAGIC[0] or payload[:4] != ZSTD_MAGIC:
            return decode(payload)
        try:
            return decode(unpack_chunk(bytes(payload), "zstd", CHUNK_LIMIT_BYTES, is_cut=False))
        except DamagedBytesError as error:
            raise BadMessageError(str(error)) from error

    return decode_packed


def _plain_decoder(channel: Channel, *, last_echo: bool) -> Decoder:
    typestore = _typestore_for(channel)
    is_ros1 = channel.encoding == "ros1"
    if channel.type == LASER_SCAN_TYPES[0] and _is_usual(typestore, LASER_SCAN_TYPES, is_ros1):
        return laser_scan_decoder(is_ros1=is_ros1)
    if channel.type == ODOMETRY_TYPES[0] and _is_usual(typestore, ODOMETRY_TYPES, is_ros1):
        return odometry_decoder(is_ros1=is_ros1)
    record_of = _RECORDS[channel.type]
    unpack = typestore.deserialize_ros1 if is_ros1 else typestore.deserialize_cdr

    def decode(payload: bytes | memoryview) -> Record:
        try:
            return record_of(unpack(payload, channel.type), last_echo)
        except Exception as error:  # a hostile definition may make any trouble
            raise BadMessageError(str(error)) from error

    return decode


def _typestore_for(channel: Channel) -> Typestore:
    """Types as the log defines them; the usual ones where it defines none, or none to be read."""
    from rosbags.typesys import get_types_from_idl

    with suppress(Exception):  # the parser lets its own and Python's errors through
        text = channel.schema[:_SCHEMA_LIMIT_BYTES].decode()
        if channel.schema_encoding in ("ros2idl", "omgidl"):
            types = {}
            for part in _idl_parts(text):
                types.update(get_types_from_idl(part))
            typestore = _typestore_of(types)
        else:
            typestore = _typestore_of_text(text, channel.type)
        typestore.get_msgdef(channel.type)
        if text.strip():
            return typestore
    return _usual_typestore(channel.encoding == "ros1")


def _typestore_of(types: Any) -> Typestore:
    from rosbags.typesys import Stores, get_typestore

    typestore = get_typestore(Stores.EMPTY)
    typestore.register(types)
    return typestore


def _typestore_of_text(text: str, name: str) -> Typestore:
    from rosbags.typesys import get_types_from_msg

    return _typestore_of(get_types_from_msg(text, name))


@cache
def _usual_typestore(is_ros1: bool) -> Typestore:
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.LATEST)


def _idl_parts(text: str) -> list[str]:
    if not text.startswith(f"{_IDL_SEPARATOR}IDL: "):
        return [text]
    return [part.partition("\n")[2] for part in text.split(_IDL_SEPARATOR)[1:]]


def _is_usual(typestore: Typestore, names: tuple[str, ...], is_ros1: bool) -> bool:
    """Whether all of the named types are defined as ROS has them.

    These few are compared with a text: to import all that ROS ever defined takes 0.1 s and more.
    """
    usual = _typestore_of_text(usual_definition(names[0], is_ros1=is_ros1), names[0])
    return all(
        name in typestore.fielddefs and typestore.fielddefs[name][1] == usual.fielddefs[name][1]
        for name in names
    )


def _stamp_ns(stamp: Any) -> int:
    return int(stamp.sec) * SECOND_NS + int(stamp.nanosec)


def _laser_scan(message: Any, last_echo: bool) -> LaserRecord:
    return _laser_record(message, float32_ranges(message.ranges))


def _multi_echo(message: Any, last_echo: bool) -> LaserRecord:
    ranges: Ranges = np.full(len(message.ranges), np.nan, dtype=np.float32)
    for beam, returns in enumerate(message.ranges):
        if len(returns.echoes):
            ranges[beam] = returns.echoes[-1 if last_echo else 0]
    return _laser_record(message, ranges)


def _laser_record(message: Any, ranges: Ranges) -> LaserRecord:
    return LaserRecord(
        _stamp_ns(message.header.stamp),
        plain_frame(message.header.frame_id),
        float(message.angle_min),
        float(message.angle_increment),
        float(message.time_increment),
        float(message.range_min),
        float(message.range_max),
        ranges,
    )


def _odometry(message: Any, last_echo: bool) -> OdometryRecord:
    pose = message.pose.pose
    q = pose.orientation
    return OdometryRecord(
        _stamp_ns(message.header.stamp),
        plain_frame(message.header.frame_id),
        plain_frame(message.child_frame_id),
        float(pose.position.x),
        float(pose.position.y),
        yaw_of_quaternion(q.x, q.y, q.z, q.w),
        oriented=any((q.x, q.y, q.z, q.w)),
    )


def _transforms(message: Any, last_echo: bool) -> list[TransformRecord]:
    return [
        TransformRecord(
            _stamp_ns(stamped.header.stamp),
            plain_frame(stamped.header.frame_id),
            plain_frame(stamped.child_frame_id),
            (
                stamped.transform.translation.x,
                stamped.transform.translation.y,
                stamped.transform.translation.z,
            ),
            (
                stamped.transform.rotation.x,
                stamped.transform.rotation.y,
                stamped.transform.rotation.z,
                stamped.transform.rotation.w,
            ),
        )
        for stamped in message.transforms
    ]


def _cloud(message: Any, last_echo: bool) -> Record:
    return cloud_record(
        message, _stamp_ns(message.header.stamp), plain_frame(message.header.frame_id)
    )


_RECORDS: dict[str, Callable[[Any, bool], Record]] = {
    "sensor_msgs/msg/LaserScan": _laser_scan,
    "sensor_msgs/msg/MultiEchoLaserScan": _multi_echo,
    "sensor_msgs/msg/PointCloud2": _cloud,
    "nav_msgs/msg/Odometry": _odometry,
    "tf2_msgs/msg/TFMessage": _transforms,
    "tf/msg/tfMessage": _transforms,
}
