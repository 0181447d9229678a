"""`sensor_msgs/LaserScan` in its usual definition, straight from its bytes."""

from __future__ import annotations

import struct
from typing import Literal, TypeAlias

import numpy as np

from bsmap_cli.logs.decoding import Decoder
from bsmap_cli.logs.messages import SECOND_NS, BadMessageError, LaserRecord, plain_frame

_ENCAPSULATION_BYTES = 4
_Layout: TypeAlias = tuple[struct.Struct, struct.Struct, np.dtype[np.float32]]


def laser_scan_decoder(*, is_ros1: bool) -> Decoder:
    """A decoder of the payloads of one channel, CDR or ROS 1."""
    frames: dict[bytes, str] = {}

    def decode(payload: bytes | memoryview) -> LaserRecord:
        order, start = ("<", 4) if is_ros1 else _cdr_order(payload)
        head, body, values = _LAYOUTS[order, is_ros1]
        try:
            seconds, nanoseconds, length = head.unpack_from(payload, start)
            name_end = start + head.size + length
            body_start = name_end if is_ros1 else name_end + -length % 4
            low, _, step, time_step, _, near, far, count = body.unpack_from(payload, body_start)
        except struct.error as error:
            raise BadMessageError("the message is cut off") from error
        ranges_start = body_start + body.size
        if ranges_start + 4 * count > len(payload):
            raise BadMessageError("the message claims more beams than it has")
        name = bytes(payload[start + head.size : name_end])
        if name not in frames:
            frames[name] = plain_frame(name.rstrip(b"\0").decode("utf-8", "replace"))
        ranges = np.frombuffer(payload, values, count, ranges_start).astype(np.float32)
        stamp_ns = seconds * SECOND_NS + nanoseconds
        return LaserRecord(stamp_ns, frames[name], low, step, time_step, near, far, ranges)

    return decode


def _layout(order: Literal["<", ">"], *, is_ros1: bool) -> _Layout:
    """Stamp and length of the frame's name; seven angles, times and limits and the beam count."""
    seconds = "I" if is_ros1 else "i"
    return (
        struct.Struct(f"{order}{seconds}II"),
        struct.Struct(f"{order}7fI"),
        np.dtype(np.float32).newbyteorder(order),
    )


_LAYOUTS = {
    ("<", True): _layout("<", is_ros1=True),
    ("<", False): _layout("<", is_ros1=False),
    (">", False): _layout(">", is_ros1=False),
}


def _cdr_order(payload: bytes | memoryview) -> tuple[str, int]:
    kind = bytes(payload[:2])
    if kind == b"\0\1":
        return "<", _ENCAPSULATION_BYTES
    if kind == b"\0\0":
        return ">", _ENCAPSULATION_BYTES
    raise BadMessageError(f"the encapsulation {kind.hex()} is not plain CDR")
