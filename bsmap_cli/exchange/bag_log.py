"""Scans as a ROS 1 bag."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from bsmap_cli.exchange.scan_messages import SCAN_TYPE, TF_TYPE, ScanMessages
from bsmap_cli.sensor.scan import Scan

_TF_DEFINITION = "geometry_msgs/TransformStamped[] transforms"
"""Not among the message types that `rosbags` ships for ROS 1."""


def write_bag(path: Path, scans: Iterable[Scan]) -> int:
    """Write the scans, in their order, to a file that does not exist yet; the number written."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    typestore = get_typestore(Stores.ROS1_NOETIC)
    typestore.register(get_types_from_msg(_TF_DEFINITION, TF_TYPE))
    writer = Writer(path)
    writer.set_compression(Writer.CompressionFormat.LZ4)
    count = 0
    with writer:
        connections = {}
        for outgoing in ScanMessages(typestore).of(scans):
            if outgoing.topic not in connections:
                connections[outgoing.topic] = writer.add_connection(
                    outgoing.topic, outgoing.type, typestore=typestore
                )
            data = typestore.serialize_ros1(outgoing.message, outgoing.type)
            writer.write(connections[outgoing.topic], outgoing.stamp_ns, data)
            count += outgoing.type == SCAN_TYPE
    return count
