"""What moves the base in a log of messages: an odometry topic, the tree of frames, or nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from bsmap_cli.errors import LogError
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.messages import OdometryRecord, TransformRecord
from bsmap_cli.logs.odometry import OdometryBuffer
from bsmap_cli.logs.reader import ReadReport
from bsmap_cli.logs.transforms import FARTHEST_M, TransformTree, planar_pose


class Motion(Protocol):
    """Feeds an `OdometryBuffer` with the messages of one kind.

    name : in a few words. topic : the odometry topic, None for transforms, "" for nothing.
    """

    name: str
    topic: str | None
    base_frame: str | None
    buffer: OdometryBuffer | None

    def take_odometry(self, topic: str, log_time_ns: int, record: OdometryRecord) -> None:
        """Push the pose of an odometry message, if it is of use here."""
        ...

    def take_transforms(self, log_time_ns: int, records: list[TransformRecord]) -> None:
        """Push the pose that transforms lead to, if they are of use here."""
        ...


@dataclass(slots=True)
class NoMotion:
    """The log tells nothing, or is not asked."""

    name: str = "none"
    topic: str | None = ""
    base_frame: str | None = None
    buffer: OdometryBuffer | None = None

    def take_odometry(self, topic: str, log_time_ns: int, record: OdometryRecord) -> None:
        """Nothing to do."""

    def take_transforms(self, log_time_ns: int, records: list[TransformRecord]) -> None:
        """Nothing to do."""


class OdometryTopic:
    """Poses from one topic.

    base_frame : where the user names another frame than the messages do, its fixed place on
    theirs is looked up in `tree`.
    frozen : the stamps stand still; the times of recording are taken, as for stamps of zero.
    """

    def __init__(
        self,
        topic: str,
        child_frame: str | None,
        base_frame: str | None,
        tree: TransformTree,
        report: ReadReport,
        frozen: bool = False,
    ) -> None:
        self.name = topic
        self._frozen = frozen
        self.topic: str | None = topic
        self.buffer: OdometryBuffer | None = OdometryBuffer()
        self.base_frame = base_frame or child_frame or None
        self._report = report
        self._pose_child_base: SE2 | None = None
        if base_frame and child_frame and base_frame != child_frame:
            matrix = tree.matrix(child_frame, base_frame)
            if matrix is None:
                raise LogError(
                    f"no transform between {child_frame} of {topic} and {base_frame}: leave out"
                    " --base-frame, or give --odom none"
                )
            self._pose_child_base = planar_pose(matrix)

    def take_odometry(self, topic: str, log_time_ns: int, record: OdometryRecord) -> None:
        """Push the pose of a message of this topic."""
        if topic != self.name or self.buffer is None:
            return
        is_sane = abs(record.x_m) < FARTHEST_M and abs(record.y_m) < FARTHEST_M
        if not (is_sane and math.isfinite(record.yaw_rad)):
            self._report.warn(f"{topic} has poses that are no numbers: they are passed over")
            return
        if not record.oriented:
            self._report.warn(f"{topic} has orientations of zeros: they are taken as heading 0")
        x_m, y_m, yaw_rad = record.x_m, record.y_m, record.yaw_rad
        if self._pose_child_base is not None:
            x_m, y_m, yaw_rad = (SE2(x_m, y_m, yaw_rad) @ self._pose_child_base).as_array().tolist()
        stamp_ns = 0 if self._frozen else record.stamp_ns
        self.buffer.push(stamp_ns or log_time_ns, x_m, y_m, yaw_rad)

    def take_transforms(self, log_time_ns: int, records: list[TransformRecord]) -> None:
        """Nothing to do."""


class TransformMotion:
    """Poses from the transforms between the odometry frame and the base."""

    def __init__(self, tree: TransformTree, odom_frame: str, base_frame: str) -> None:
        self.name = f"tf {odom_frame} -> {base_frame}"
        self.topic: str | None = None
        self.base_frame: str | None = base_frame
        self.buffer: OdometryBuffer | None = OdometryBuffer()
        self._tree = tree
        self._odom_frame = odom_frame
        chain = tree.ancestors(base_frame)
        self._joints = frozenset(chain[: chain.index(odom_frame)])

    def take_odometry(self, topic: str, log_time_ns: int, record: OdometryRecord) -> None:
        """Nothing to do."""

    def take_transforms(self, log_time_ns: int, records: list[TransformRecord]) -> None:
        """Push the pose of the base where a joint on its way to the odometry frame has moved."""
        moved = [r for r in records if r.child in self._joints and self._tree.add(r)]
        if not moved or self.buffer is None:
            return
        matrix = self._tree.matrix(self._odom_frame, self.base_frame or "")
        if matrix is not None:
            pose = planar_pose(matrix)
            self.buffer.push(moved[-1].stamp_ns or log_time_ns, pose.x, pose.y, pose.theta)
