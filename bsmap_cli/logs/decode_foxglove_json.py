"""foxglove messages as JSON: `LaserScan`, `PoseInFrame`, `FrameTransform(s)`."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np

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


def json_decoder(type_name: str) -> Decoder:
    """A decoder for one of the types of `_RECORDS`."""
    record_of = _RECORDS[type_name]

    def decode(payload: bytes | memoryview) -> Record:
        try:
            return record_of(json.loads(bytes(payload)))
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise BadMessageError(f"not the JSON of {type_name} ({error})") from error
        except OverflowError as error:
            raise BadMessageError(f"a number beyond all bounds in {type_name}") from error

    return decode


def _laser_scan(message: dict[str, Any]) -> LaserRecord:
    ranges = [math.nan if value is None else float(value) for value in message["ranges"]]
    pose = message.get("pose")
    return laser_record(
        stamp_ns=_stamp_ns(message.get("timestamp")),
        frame=str(message.get("frame_id", "")),
        start_rad=float(message["start_angle"]),
        end_rad=float(message["end_angle"]),
        ranges=np.array(ranges, dtype=np.float64),
        pose=None if pose is None else (*_xyz(pose["position"]), *_xyzw(pose["orientation"])),
    )


def _pose_in_frame(message: dict[str, Any]) -> OdometryRecord:
    pose = message["pose"]
    position, quaternion = _xyz(pose["position"]), _xyzw(pose["orientation"])
    return OdometryRecord(
        _stamp_ns(message.get("timestamp")),
        plain_frame(str(message.get("frame_id", ""))),
        "",
        position[0],
        position[1],
        yaw_of_quaternion(*quaternion),
        oriented=any(quaternion),
    )


def _transform(message: dict[str, Any]) -> TransformRecord:
    return TransformRecord(
        _stamp_ns(message.get("timestamp")),
        plain_frame(str(message["parent_frame_id"])),
        plain_frame(str(message["child_frame_id"])),
        _xyz(message["translation"]),
        _xyzw(message["rotation"]),
    )


def _stamp_ns(stamp: Any) -> int:
    """`{"sec", "nsec"}`, or the text that protobuf's JSON has."""
    if isinstance(stamp, dict):
        seconds: Any = stamp.get("sec", stamp.get("seconds", 0))
        nanoseconds: Any = stamp.get("nsec", stamp.get("nanos", 0))
        return int(seconds) * SECOND_NS + int(nanoseconds)
    if isinstance(stamp, str):
        return _stamp_ns_of_text(stamp)
    return 0


def _stamp_ns_of_text(text: str) -> int:
    from datetime import UTC, datetime

    whole, _, fraction = text.removesuffix("Z").partition(".")
    moment = datetime.fromisoformat(whole).replace(tzinfo=UTC)
    days = moment - datetime(1970, 1, 1, tzinfo=UTC)
    seconds = days.days * 86400 + days.seconds
    return seconds * SECOND_NS + int((fraction or "0")[:9].ljust(9, "0"))


def _xyz(vector: dict[str, Any]) -> tuple[float, float, float]:
    return float(vector.get("x", 0)), float(vector.get("y", 0)), float(vector.get("z", 0))


def _xyzw(quaternion: dict[str, Any]) -> tuple[float, float, float, float]:
    return (*_xyz(quaternion), float(quaternion.get("w", 0)))


_RECORDS: dict[str, Callable[[dict[str, Any]], Record]] = {
    "foxglove.LaserScan": _laser_scan,
    "foxglove.PoseInFrame": _pose_in_frame,
    "foxglove.FrameTransform": lambda message: [_transform(message)],
    "foxglove.FrameTransforms": lambda message: [_transform(one) for one in message["transforms"]],
}
