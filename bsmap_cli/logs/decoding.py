"""Which messages are of use, and how each channel's messages are decoded."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import TypeAlias

from bsmap_cli.logs.messages import Channel, Record

Decoder: TypeAlias = "Callable[[bytes | memoryview], Record]"
"""From a payload to a record; raises BadMessageError for a message that cannot be used."""


class Kind(Enum):
    """What a channel is good for."""

    SCAN = "scan"
    CLOUD = "cloud"
    ODOMETRY = "odometry"
    TRANSFORMS = "transforms"


_ROS_KINDS = {
    "sensor_msgs/msg/LaserScan": Kind.SCAN,
    "sensor_msgs/msg/MultiEchoLaserScan": Kind.SCAN,
    "sensor_msgs/msg/PointCloud2": Kind.CLOUD,
    "nav_msgs/msg/Odometry": Kind.ODOMETRY,
    "tf2_msgs/msg/TFMessage": Kind.TRANSFORMS,
    "tf/msg/tfMessage": Kind.TRANSFORMS,
}
_FOXGLOVE_KINDS = {
    "foxglove.LaserScan": Kind.SCAN,
    "foxglove.PoseInFrame": Kind.ODOMETRY,
    "foxglove.FrameTransform": Kind.TRANSFORMS,
    "foxglove.FrameTransforms": Kind.TRANSFORMS,
}


def kind_of(channel: Channel) -> Kind | None:
    """What the channel is good for, or None."""
    if channel.encoding in ("cdr", "ros1"):
        return _ROS_KINDS.get(channel.type)
    if channel.encoding in ("json", "protobuf"):
        return _FOXGLOVE_KINDS.get(channel.type)
    return None


def decoder_for(channel: Channel, *, last_echo: bool) -> Decoder:
    """The decoder of a channel that has a kind; last_echo : of a MultiEchoLaserScan."""
    if channel.encoding == "json":
        from bsmap_cli.logs.decode_foxglove_json import json_decoder

        return json_decoder(channel.type)
    if channel.encoding == "protobuf":
        from bsmap_cli.logs.decode_foxglove_protobuf import protobuf_decoder

        return protobuf_decoder(channel.type)
    from bsmap_cli.logs.decode_ros import ros_decoder

    return ros_decoder(channel, last_echo=last_echo)
