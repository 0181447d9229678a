"""Scans as ROS messages: what the MCAP and bag writers share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from bsmap_cli.errors import LogError
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import canonical_yaw, float32_value, quaternion_of_yaw
from bsmap_cli.sensor.scan import Scan

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

BASE_FRAME = "base_link"
ODOM_FRAME = "odom"
SCAN_TYPE = "sensor_msgs/msg/LaserScan"
ODOM_TYPE = "nav_msgs/msg/Odometry"
TF_TYPE = "tf2_msgs/msg/TFMessage"
_SECOND_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class OutgoingMessage:
    """One message of a log to be written; `message` is an object of the typestore."""

    topic: str
    type: str
    stamp_ns: int
    message: Any


class ScanMessages:
    """Turns scans into the messages of one log, in the order in which they are written.

    The laser's frame is `laser` (numbered where there are several topics), or `base_link` where
    the laser is the base. Its transform stands on `/tf_static` before the first scan of its topic.
    """

    def __init__(self, typestore: Typestore) -> None:
        self._types = typestore.types
        self._frames: dict[str, str] = {}
        self._with_sequence = "seq" in self._types["std_msgs/msg/Header"].__annotations__

    def of(self, scans: Iterable[Scan]) -> Iterator[OutgoingMessage]:
        """The messages of all scans; raises LogError for a stamp that ROS cannot hold."""
        for scan in scans:
            topic = scan.topic if scan.topic.startswith("/") else "/scan"
            stamp = scan.stamp_ns
            if not 0 <= stamp < 2**31 * _SECOND_NS:
                raise LogError(
                    f"the stamp {stamp} ns does not fit a ROS message (0 to 2^31 s): write csv"
                )
            if topic not in self._frames:
                self._frames[topic] = self._new_frame(scan.pose_base_laser)
                if scan.pose_base_laser != SE2.identity():
                    transform = self._static_transform(scan, self._frames[topic])
                    yield OutgoingMessage("/tf_static", TF_TYPE, stamp, transform)
            if scan.pose_odom_base is not None:
                odometry = self._odometry(stamp, scan.pose_odom_base)
                yield OutgoingMessage("/odom", ODOM_TYPE, stamp, odometry)
            yield OutgoingMessage(
                topic, SCAN_TYPE, stamp, self._laser_scan(scan, self._frames[topic])
            )

    def _new_frame(self, pose_base_laser: SE2) -> str:
        if pose_base_laser == SE2.identity():
            return BASE_FRAME
        return f"laser_{len(self._frames) + 1}" if self._frames else "laser"

    def _header(self, stamp_ns: int, frame: str) -> Any:
        time = self._types["builtin_interfaces/msg/Time"](
            sec=stamp_ns // _SECOND_NS, nanosec=stamp_ns % _SECOND_NS
        )
        sequence = {"seq": 0} if self._with_sequence else {}
        return self._types["std_msgs/msg/Header"](stamp=time, frame_id=frame, **sequence)

    def _laser_scan(self, scan: Scan, frame: str) -> Any:
        span_rad = (len(scan.ranges_m) - 1) * scan.angle_increment_rad
        return self._types[SCAN_TYPE](
            header=self._header(scan.stamp_ns, frame),
            angle_min=scan.angle_min_rad,
            angle_max=float32_value(scan.angle_min_rad + span_rad),
            angle_increment=scan.angle_increment_rad,
            time_increment=scan.time_increment_s,
            scan_time=0.0,
            range_min=scan.range_min_m,
            range_max=scan.range_max_m,
            ranges=np.ascontiguousarray(scan.ranges_m, dtype=np.float32),
            intensities=np.zeros(0, dtype=np.float32),
        )

    def _odometry(self, stamp_ns: int, pose_odom_base: SE2) -> Any:
        types = self._types
        zero = types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0)
        pose = types["geometry_msgs/msg/Pose"](
            position=types["geometry_msgs/msg/Point"](
                x=pose_odom_base.x, y=pose_odom_base.y, z=0.0
            ),
            orientation=self._quaternion(pose_odom_base.theta),
        )
        unknown = np.zeros(36)
        return types[ODOM_TYPE](
            header=self._header(stamp_ns, ODOM_FRAME),
            child_frame_id=BASE_FRAME,
            pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=unknown),
            twist=types["geometry_msgs/msg/TwistWithCovariance"](
                twist=types["geometry_msgs/msg/Twist"](linear=zero, angular=zero),
                covariance=unknown,
            ),
        )

    def _static_transform(self, scan: Scan, frame: str) -> Any:
        types = self._types
        pose = scan.pose_base_laser
        transform = types["geometry_msgs/msg/Transform"](
            translation=types["geometry_msgs/msg/Vector3"](x=pose.x, y=pose.y, z=0.0),
            rotation=self._quaternion(pose.theta),
        )
        stamped = types["geometry_msgs/msg/TransformStamped"](
            header=self._header(scan.stamp_ns, BASE_FRAME),
            child_frame_id=frame,
            transform=transform,
        )
        return types[TF_TYPE](transforms=[stamped])

    def _quaternion(self, yaw_rad: float) -> Any:
        yaw_rad = canonical_yaw(yaw_rad) if math.isfinite(yaw_rad) else 0.0
        x, y, z, w = quaternion_of_yaw(yaw_rad)
        return self._types["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w)
