"""An MCAP file of the ROS 2 profile to a stream that need not seek: messages of ROS and of JSON."""

from __future__ import annotations

import json
from typing import Any, BinaryIO

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


class McapFile:
    """Chunks are zstd with checksums; the same messages give the same bytes."""

    def __init__(self, stream: BinaryIO) -> None:
        from mcap.writer import CompressionType, Writer
        from rosbags.typesys import Stores, get_typestore

        self.typestore = get_typestore(Stores.ROS2_HUMBLE)
        self._writer = Writer(
            _CountingStream(stream),  # type: ignore[arg-type]
            chunk_size=_CHUNK_BYTES,
            compression=CompressionType.ZSTD,
            enable_crcs=True,
            enable_data_crcs=True,
        )
        self._writer.start(profile="ros2", library="bsmap")
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}

    def add_ros(
        self, topic: str, type_: str, stamp_ns: int, message: Any, sequence: int = 0
    ) -> None:
        """Write an object of `typestore` as CDR with its definition; stamp_ns is log time too."""
        if topic not in self._channels:
            definition, _ = self.typestore.generate_msgdef(type_, ros_version=2)
            self._register(topic, "cdr", type_, ("ros2msg", definition))
        data = bytes(self.typestore.serialize_cdr(message, type_))
        self._writer.add_message(self._channels[topic], stamp_ns, data, stamp_ns, sequence)

    def add_json(
        self, topic: str, type_: str, stamp_ns: int, message: Any, schema: dict[str, Any]
    ) -> None:
        """Write JSON values as a message of a schema that viewers know by its name."""
        if topic not in self._channels:
            self._register(topic, "json", type_, ("jsonschema", json.dumps(schema)))
        data = json.dumps(message, separators=(",", ":"), allow_nan=False).encode()
        self._writer.add_message(self._channels[topic], stamp_ns, data, stamp_ns)

    def finish(self) -> None:
        """Write the index and the end."""
        self._writer.finish()  # type: ignore[no-untyped-call]

    def _register(self, topic: str, encoding: str, type_: str, schema: tuple[str, str]) -> None:
        if type_ not in self._schemas:
            self._schemas[type_] = self._writer.register_schema(
                type_, schema[0], schema[1].encode()
            )
        self._channels[topic] = self._writer.register_channel(topic, encoding, self._schemas[type_])
