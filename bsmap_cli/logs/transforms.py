"""The tree of frames of a log, and where a laser sits on its base."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import canonical_pose
from bsmap_cli.logs.messages import TransformRecord

Matrix = NDArray[np.float64]

ODOM_NAME = "odom"
BASE_NAMES = ("base_footprint", "base_link", "base")
_WORLD_NAMES = ("map", "world", "earth")
FARTHEST_M = 1e9
"""Coordinates beyond this are no coordinates."""

_TILT_LIMIT_RAD = math.radians(10.0)
_STILL_M, _STILL_COS = 1e-3, math.cos(math.radians(0.1))


@dataclass(frozen=True, slots=True)
class Mounting:
    """Where a laser sits on the base.

    pose_base_laser : its place in the plane. upside_down : its beams turn clockwise seen from
    above. tilt_rad : angle between its axis and the vertical. matrix : (4, 4) base from laser.
    """

    pose_base_laser: SE2
    upside_down: bool = False
    tilt_rad: float = 0.0
    matrix: Matrix | None = None

    @property
    def is_tilted(self) -> bool:
        """Whether the beams leave the plane by more than a mounting is askew."""
        return self.tilt_rad > _TILT_LIMIT_RAD


@dataclass(slots=True)
class _Edge:
    parent: str
    matrix: Matrix
    first: Matrix
    moved: bool = False


class TransformTree:
    """The latest transform of every frame to its parent."""

    def __init__(self) -> None:
        self._edges: dict[str, _Edge] = {}

    def add(self, record: TransformRecord) -> bool:
        """Take note of one transform; False where it holds no usable numbers."""
        matrix = matrix_of(record.translation, record.quaternion)
        if matrix is None or record.parent == record.child:
            return False
        edge = self._edges.get(record.child)
        if edge is None or edge.parent != record.parent:
            self._edges[record.child] = _Edge(record.parent, matrix, matrix)
        else:
            edge.matrix = matrix
            edge.moved = edge.moved or _differ(matrix, edge.first)
        return True

    def ancestors(self, frame: str) -> list[str]:
        """The frame, its parent, and so on up to the root."""
        chain = [frame]
        while (edge := self._edges.get(chain[-1])) is not None and edge.parent not in chain:
            chain.append(edge.parent)
        return chain

    def matrix(self, target: str, source: str) -> Matrix | None:
        """(4, 4) matrix that takes points of `source` to `target`, or None if not connected."""
        up_target, up_source = self.ancestors(target), self.ancestors(source)
        common = next((frame for frame in up_source if frame in up_target), None)
        if common is None:
            return None
        common_source = self._to_ancestor(up_source, common)
        common_target = self._to_ancestor(up_target, common)
        return np.linalg.inv(common_target) @ common_source

    def moves(self, target: str, source: str) -> bool:
        """Whether a joint between the two frames was seen to move."""
        up_target, up_source = self.ancestors(target), self.ancestors(source)
        between = set(up_target) ^ set(up_source)
        return any(self._edges[frame].moved for frame in between if frame in self._edges)

    def base_under_odom(self, laser_frames: list[str]) -> tuple[str, str] | None:
        """`(odom, base)`: the odometry frame and its child towards the lasers, or None."""
        for laser in laser_frames:
            chain = self.ancestors(laser)
            for base, odom in pairwise(chain):
                if is_odom(odom):
                    return odom, base
        children = sorted(child for child, edge in self._edges.items() if is_odom(edge.parent))
        if not children:
            return None
        base = min(children, key=lambda child: (_last(child) not in BASE_NAMES, child))
        return self._edges[base].parent, base

    def likely_base(self, laser: str) -> str | None:
        """The base above a laser in a tree without odometry, or None if the tree has none."""
        chain = [frame for frame in self.ancestors(laser) if not is_world(frame)]
        named = [frame for frame in chain if _last(frame) in BASE_NAMES]
        if named:
            return named[-1]
        return chain[-1] if len(chain) > 1 else None

    def _to_ancestor(self, chain: list[str], ancestor: str) -> Matrix:
        matrix = np.eye(4)
        for frame in chain[: chain.index(ancestor)]:
            matrix = self._edges[frame].matrix @ matrix
        return matrix


def is_odom(frame: str) -> bool:
    """Whether a frame is an odometry frame by its name, also below a robot's prefix."""
    return _last(frame).startswith(ODOM_NAME)


def is_world(frame: str) -> bool:
    """Whether a frame does not move with the robot, by its name."""
    return _last(frame) in _WORLD_NAMES or is_odom(frame)


def is_base(frame: str) -> bool:
    """Whether a frame is a robot's base by its name, also below a robot's prefix."""
    return _last(frame) in BASE_NAMES


def mounting_of(matrix_base_laser: Matrix) -> Mounting:
    """The planar part of a laser's place, and how the laser is turned."""
    rotation = matrix_base_laser[:3, :3]
    up = float(np.clip(rotation[2, 2], -1.0, 1.0))
    return Mounting(
        pose_base_laser=planar_pose(matrix_base_laser),
        upside_down=up < 0.0,
        tilt_rad=math.acos(abs(up)),
        matrix=matrix_base_laser,
    )


def planar_pose(matrix: Matrix) -> SE2:
    """x, y and the heading of the x axis of a (4, 4) matrix."""
    yaw = math.atan2(matrix[1, 0], matrix[0, 0])
    return canonical_pose(float(matrix[0, 3]), float(matrix[1, 3]), yaw)


def _last(frame: str) -> str:
    return frame.rpartition("/")[2]


def matrix_of(translation: Sequence[float], quaternion: Sequence[float]) -> Matrix | None:
    """(4, 4) matrix of x, y, z [m] and a quaternion x, y, z, w; None where they are no numbers."""
    length = math.hypot(*quaternion)
    if not (all(map(_is_sane, translation)) and 1e-6 < length < 1e6):
        return None
    x, y, z, w = (number / length for number in quaternion)
    matrix = np.eye(4)
    matrix[:3, :3] = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    matrix[:3, 3] = translation
    return matrix


def _is_sane(length_m: float) -> bool:
    return abs(length_m) < FARTHEST_M


def _differ(a: Matrix, b: Matrix) -> bool:
    if float(np.abs(a[:3, 3] - b[:3, 3]).max()) > _STILL_M:
        return True
    cos = (float(np.trace(a[:3, :3].T @ b[:3, :3])) - 1.0) / 2.0
    return cos < _STILL_COS
