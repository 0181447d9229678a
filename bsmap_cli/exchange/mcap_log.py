"""Scans as an MCAP file of the ROS 2 profile: what `ros2 bag play` and Foxglove open."""

from __future__ import annotations

from collections.abc import Iterable
from typing import BinaryIO

from bsmap_cli.exchange.mcap_file import McapFile
from bsmap_cli.exchange.scan_messages import ScanMessages
from bsmap_cli.sensor.scan import Scan


def write_mcap(stream: BinaryIO, scans: Iterable[Scan]) -> int:
    """Write the scans, in their order, to a stream that need not seek; the number written.

    Schemas are `ros2msg`, messages CDR, chunks zstd with checksums. Times of the log are the
    stamps of the scans, so the same scans give the same bytes.
    """
    file = McapFile(stream)
    count = 0
    for outgoing in ScanMessages(file.typestore).of(scans):
        file.add_ros(outgoing.topic, outgoing.type, outgoing.stamp_ns, outgoing.message, count)
        count += outgoing.topic not in ("/odom", "/tf_static")
    file.finish()
    return count
