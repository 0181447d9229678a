"""What a container of messages gives, before and after its messages are decoded."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.logs.reader import ReadReport
from bsmap_cli.sensor.scan import Ranges

SECOND_NS = 1_000_000_000


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Channel:
    """One stream of messages in one file; compared by identity.

    type : `package/msg/Name` for ROS 1 and 2 alike, else as the container has it.
    encoding : of the messages: "cdr", "ros1", "protobuf", "json" or another.
    schema_encoding, schema : how the type is defined: "ros2msg", "ros2idl", "ros1msg", ...
    """

    topic: str
    type: str
    encoding: str
    schema_encoding: str = ""
    schema: bytes = b""


RawMessage: TypeAlias = tuple[Channel, int, "bytes | memoryview"]
"""Channel, time of recording [ns], payload (valid until the next message is drawn)."""


@dataclass(slots=True, kw_only=True)
class ContainerIndex:
    """What a container knows without being read through.

    counts : messages of each channel; start_ns, end_ns : first and last time of recording.
    """

    counts: dict[Channel, int] = field(default_factory=dict)
    start_ns: int = 0
    end_ns: int = 0


class Container(Protocol):
    """One file or stream of messages."""

    name: str
    format: str

    def index(self) -> ContainerIndex | None:
        """What is known without reading through, or None."""
        ...

    def messages(
        self, wants: Callable[[Channel], bool], report: ReadReport
    ) -> Iterator[RawMessage]:
        """The messages of the wanted channels, in the order of the file.

        Damage ends the stream early, is told to `report` and raises nothing. Other channels
        still pass `wants` once, when they are declared.
        """
        ...


class LaserRecord(NamedTuple):
    """A planar scan as its message has it.

    pose_frame_laser : x, y, z [m] and quaternion x, y, z, w of the laser in `frame`, where the
        message has them.
    """

    stamp_ns: int
    frame: str
    angle_min_rad: float
    angle_increment_rad: float
    time_increment_s: float
    range_min_m: float
    range_max_m: float
    ranges_m: Ranges
    pose_frame_laser: tuple[float, ...] | None = None


class CloudRecord(NamedTuple):
    """points : (m, 3) float64 [m] in `frame`; columns : of an organised cloud, else 0."""

    stamp_ns: int
    frame: str
    points: NDArray[np.float64]
    columns: int


class OdometryRecord(NamedTuple):
    """Pose of `child_frame` in `frame`; `oriented` is False for a quaternion of zeros."""

    stamp_ns: int
    frame: str
    child_frame: str
    x_m: float
    y_m: float
    yaw_rad: float
    oriented: bool


class TransformRecord(NamedTuple):
    """Pose of `child` in `parent`: translation [m], unit quaternion x, y, z, w."""

    stamp_ns: int
    parent: str
    child: str
    translation: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]


Record: TypeAlias = LaserRecord | CloudRecord | OdometryRecord | list[TransformRecord]


class BadMessageError(Exception):
    """One message cannot be used; the rest of the log can."""


def normal_type(name: str) -> str:
    """`sensor_msgs/LaserScan` of ROS 1 as `sensor_msgs/msg/LaserScan`; others unchanged."""
    package, slash, rest = name.partition("/")
    return f"{package}/msg/{rest}" if slash and "/" not in rest else name


def plain_frame(name: str) -> str:
    """A frame without the leading slash of ROS 1."""
    return name.removeprefix("/")
