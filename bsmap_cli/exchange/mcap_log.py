"""Scans as an MCAP file of the ROS 2 profile: what `ros2 bag play` and Foxglove open."""

from __future__ import annotations

from collections.abc import Iterable
from typing import BinaryIO

from bsmap_cli.exchange.scan_messages import ScanMessages
from bsmap_cli.sensor.scan import Scan

_CHUNK_BYTES = 1 << 20


class _CountingStream:
    """Gives a pipe the `tell` that the MCAP writer asks for."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._position = 0

    def write(self, data: bytes) -> int:
        self._stream.write(data)
        self._position += len(data)
        return len(data)

    def tell(self) -> int:
        return self._position


def write_mcap(stream: BinaryIO, scans: Iterable[Scan]) -> int:
    """Write the scans, in their order, to a stream that need not seek; the number written.

    Schemas are `ros2msg`, messages CDR, chunks zstd with checksums. Times of the log are the
    stamps of the scans, so the same scans give the same bytes.
    """
    from mcap.writer import CompressionType, Writer
    from rosbags.typesys import Stores, get_typestore

    typestore = get_typestore(Stores.ROS2_HUMBLE)
    writer = Writer(
        _CountingStream(stream),  # type: ignore[arg-type]
        chunk_size=_CHUNK_BYTES,
        compression=CompressionType.ZSTD,
        enable_crcs=True,
        enable_data_crcs=True,
    )
    writer.start(profile="ros2", library="bsmap")
    channels: dict[str, int] = {}
    schemas: dict[str, int] = {}
    count = 0
    for outgoing in ScanMessages(typestore).of(scans):
        if outgoing.type not in schemas:
            definition, _ = typestore.generate_msgdef(outgoing.type, ros_version=2)
            schemas[outgoing.type] = writer.register_schema(
                outgoing.type, "ros2msg", definition.encode()
            )
        if outgoing.topic not in channels:
            channels[outgoing.topic] = writer.register_channel(
                outgoing.topic, "cdr", schemas[outgoing.type]
            )
        data = bytes(typestore.serialize_cdr(outgoing.message, outgoing.type))
        writer.add_message(
            channels[outgoing.topic], outgoing.stamp_ns, data, outgoing.stamp_ns, count
        )
        count += outgoing.topic not in ("/odom", "/tf_static")
    writer.finish()  # type: ignore[no-untyped-call]
    return count
