"""foxglove messages as protobuf: `LaserScan`, `PoseInFrame`, `FrameTransform(s)`.

The wire format is simple enough to be read here: https://protobuf.dev/programming-guides/encoding.
Field numbers are those of foxglove's published schemas, which never change.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.logs.canonical import yaw_of_quaternion
from bsmap_cli.logs.decoding import Decoder
from bsmap_cli.logs.foxglove import laser_record
from bsmap_cli.logs.messages import (
    SECOND_NS,
    BadMessageError,
    LaserRecord,
    OdometryRecord,
    Record,
    TransformRecord,
    plain_frame,
)

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_DOUBLE = struct.Struct("<d")
_VARINT_BITS = 70

_Value = int | bytes


def protobuf_decoder(type_name: str) -> Decoder:
    """A decoder for one of the types of `_RECORDS`."""
    record_of = _RECORDS[type_name]

    def decode(payload: bytes | memoryview) -> Record:
        try:
            return record_of(bytes(payload))
        except (ValueError, TypeError, IndexError, struct.error) as error:
            raise BadMessageError(f"not the protobuf of {type_name} ({error})") from error

    return decode


def _laser_scan(data: bytes) -> LaserRecord:
    stamp_ns, frame, pose, angles, ranges = 0, "", None, [0.0, 0.0], []
    for number, value in _fields(data):
        if number == 1:
            stamp_ns = _stamp_ns(_bytes(value))
        elif number == 2:
            frame = _text(value)
        elif number == 3:
            pose = _pose(_bytes(value))
        elif number in (4, 5):
            angles[number - 4] = _double(value)
        elif number == 6:
            ranges.append(_doubles(_bytes(value)))
    return laser_record(
        stamp_ns=stamp_ns,
        frame=frame,
        start_rad=angles[0],
        end_rad=angles[1],
        ranges=np.concatenate(ranges) if ranges else np.zeros(0),
        pose=pose,
    )


def _pose_in_frame(data: bytes) -> OdometryRecord:
    stamp_ns, frame = 0, ""
    pose: tuple[float, ...] = (0.0,) * 7
    for number, value in _fields(data):
        if number == 1:
            stamp_ns = _stamp_ns(_bytes(value))
        elif number == 2:
            frame = _text(value)
        elif number == 3:
            pose = _pose(_bytes(value))
    x, y, _, *quaternion = pose
    return OdometryRecord(
        stamp_ns,
        plain_frame(frame),
        "",
        x,
        y,
        yaw_of_quaternion(*quaternion),
        oriented=any(quaternion),
    )


def _transform(data: bytes) -> TransformRecord:
    stamp_ns, frames = 0, ["", ""]
    translation, rotation = (0.0,) * 4, (0.0,) * 4
    for number, value in _fields(data):
        if number == 1:
            stamp_ns = _stamp_ns(_bytes(value))
        elif number in (2, 3):
            frames[number - 2] = plain_frame(_text(value))
        elif number == 4:
            translation = _vector(_bytes(value))
        elif number == 5:
            rotation = _vector(_bytes(value))
    return TransformRecord(stamp_ns, frames[0], frames[1], translation[:3], rotation)


def _transforms(data: bytes) -> list[TransformRecord]:
    return [_transform(_bytes(value)) for number, value in _fields(data) if number == 1]


def _fields(data: bytes) -> Iterator[tuple[int, _Value]]:
    """Field numbers with varints as they are, everything else as bytes."""
    position = 0
    while position < len(data):
        key, position = _varint(data, position)
        kind = key & 7
        value: _Value
        if kind == _VARINT:
            value, position = _varint(data, position)
        else:
            if kind == _BYTES:
                length, position = _varint(data, position)
            elif kind in (_FIXED64, _FIXED32):
                length = 8 if kind == _FIXED64 else 4
            else:
                raise ValueError(f"wire type {kind}")
            value = data[position : position + length]
            position += length
            if position > len(data):
                raise ValueError("a field is cut off")
        yield key >> 3, value


def _varint(data: bytes, position: int) -> tuple[int, int]:
    value = 0
    for shift in range(0, _VARINT_BITS, 7):
        byte = data[position]
        position += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, position
    raise ValueError("an endless number")


def _bytes(value: _Value) -> bytes:
    if isinstance(value, int):
        raise TypeError("a number where a message belongs")
    return value


def _text(value: _Value) -> str:
    return _bytes(value).decode("utf-8", "replace")


def _double(value: _Value) -> float:
    return float(_DOUBLE.unpack(_bytes(value))[0])


def _doubles(data: bytes) -> NDArray[np.float64]:
    return np.frombuffer(data, "<f8")


def _stamp_ns(data: bytes) -> int:
    seconds = nanoseconds = 0
    for number, value in _fields(data):
        if isinstance(value, int) and number == 1:
            seconds = value - (1 << 64) if value >= 1 << 63 else value
        elif isinstance(value, int) and number == 2:
            nanoseconds = value
    return seconds * SECOND_NS + nanoseconds


def _pose(data: bytes) -> tuple[float, ...]:
    position, orientation = (0.0,) * 4, (0.0,) * 4
    for number, value in _fields(data):
        if number == 1:
            position = _vector(_bytes(value))
        elif number == 2:
            orientation = _vector(_bytes(value))
    return *position[:3], *orientation


def _vector(data: bytes) -> tuple[float, float, float, float]:
    """x, y, z and, of a quaternion, w."""
    numbers = [0.0, 0.0, 0.0, 0.0]
    for number, value in _fields(data):
        if 1 <= number <= 4:
            numbers[number - 1] = _double(value)
    return numbers[0], numbers[1], numbers[2], numbers[3]


_RECORDS: dict[str, Callable[[bytes], Record]] = {
    "foxglove.LaserScan": _laser_scan,
    "foxglove.PoseInFrame": _pose_in_frame,
    "foxglove.FrameTransform": lambda data: [_transform(data)],
    "foxglove.FrameTransforms": _transforms,
}
