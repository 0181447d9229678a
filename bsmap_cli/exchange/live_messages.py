"""The messages of a live view, in the schemas of the Foxglove SDK; importing it imports that."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np
from foxglove.messages import (
    Color,
    FrameTransform,
    FrameTransforms,
    LaserScan,
    LinePrimitive,
    Point3,
    Pose,
    PosesInFrame,
    Quaternion,
    SceneEntity,
    SceneEntityDeletion,
    SceneEntityDeletionType,
    SceneUpdate,
    Timestamp,
    Vector3,
)

from bsmap_cli.exchange.line_colours import LINE_PIXELS, coloured_lines
from bsmap_cli.exchange.selection import SelectedLevel
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import quaternion_of_yaw
from bsmap_cli.mapping.map_document import MapLevel
from bsmap_cli.mapping.sampling import drawn_pieces
from bsmap_cli.sensor.scan import Scan

MAP_FRAME, BASE_FRAME = "map", "base_link"
TOLERANCE_M = 0.005
_SECOND_NS = 1_000_000_000


def laser_scan(scan: Scan, stamp_ns: int) -> LaserScan:
    """The returns of a scan in the base frame; what is no return is NaN."""
    ranges = scan.ranges_m.astype(np.float64)
    with np.errstate(invalid="ignore"):
        valid = (ranges >= scan.range_min_m) & (ranges <= scan.range_max_m) & (ranges > 0.0)
    sweep = scan.angle_increment_rad * max(len(ranges) - 1, 0)
    return LaserScan(
        timestamp=_time(stamp_ns),
        frame_id=BASE_FRAME,
        pose=_pose(scan.pose_base_laser),
        start_angle=scan.angle_min_rad,
        end_angle=scan.angle_min_rad + sweep,
        ranges=np.where(valid & np.isfinite(ranges), ranges, math.nan).tolist(),
    )


def transforms(poses: Iterable[tuple[str, SE2]], stamp_ns: int) -> FrameTransforms:
    """Frames and their poses in the map."""
    return FrameTransforms(transforms=[_transform(name, pose, stamp_ns) for name, pose in poses])


def path(poses: Iterable[SE2], stamp_ns: int) -> PosesInFrame:
    """Poses in the map frame."""
    shown = [_pose(pose) for pose in poses]
    return PosesInFrame(timestamp=_time(stamp_ns), frame_id=MAP_FRAME, poses=shown)


def curves(name: str, frame: str, level: MapLevel, max_weight: int, stamp_ns: int) -> SceneEntity:
    """The curves of a level as one entity of the scene, fixed to a frame."""
    selected = SelectedLevel(level, drawn_pieces(level))
    return SceneEntity(
        timestamp=_time(stamp_ns),
        frame_id=frame,
        id=name,
        frame_locked=True,
        lines=[
            LinePrimitive(
                thickness=LINE_PIXELS,
                scale_invariant=True,
                points=[Point3(x=x, y=y, z=0.0) for x, y in line.tolist()],
                color=Color(r=red, g=green, b=blue, a=1.0),
            )
            for line, (red, green, blue) in coloured_lines(selected, max_weight, TOLERANCE_M)
        ],
    )


def scene(
    entities: Sequence[SceneEntity], *, instead_of_all: bool = False, stamp_ns: int
) -> SceneUpdate:
    """Entities that replace those of their names, or everything that is shown."""
    everything = SceneEntityDeletion(timestamp=_time(stamp_ns), type=SceneEntityDeletionType.All)
    return SceneUpdate(deletions=[everything] if instead_of_all else [], entities=list(entities))


def _time(stamp_ns: int) -> Timestamp:
    return Timestamp(*divmod(stamp_ns, _SECOND_NS))


def _rotation(yaw_rad: float) -> Quaternion:
    x, y, z, w = quaternion_of_yaw(yaw_rad)
    return Quaternion(x=x, y=y, z=z, w=w)


def _pose(pose: SE2) -> Pose:
    position = Vector3(x=pose.x, y=pose.y, z=0.0)
    return Pose(position=position, orientation=_rotation(pose.theta))


def _transform(name: str, pose_map_frame: SE2, stamp_ns: int) -> FrameTransform:
    return FrameTransform(
        timestamp=_time(stamp_ns),
        parent_frame_id=MAP_FRAME,
        child_frame_id=name,
        translation=Vector3(x=pose_map_frame.x, y=pose_map_frame.y, z=0.0),
        rotation=_rotation(pose_map_frame.theta),
    )
