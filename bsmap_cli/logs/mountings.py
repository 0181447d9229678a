"""Where each laser of a log sits on the base, and what is said where the log does not tell."""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.logs.messages import TransformRecord
from bsmap_cli.logs.reader import TELL_PLACE, ReadOptions, ReadReport
from bsmap_cli.logs.transforms import (
    Matrix,
    Mounting,
    TransformTree,
    is_base,
    is_world,
    matrix_of,
    mounting_of,
)


class Mountings:
    """Finds the mounting of a laser by its frame: the option, the tree of frames, or the base.

    base_frame : where known; else the likely base above the laser.
    """

    def __init__(
        self,
        tree: TransformTree,
        base_frame: str | None,
        options: ReadOptions,
        report: ReadReport,
    ) -> None:
        self._tree = tree
        self._base_frame = base_frame
        self._options = options
        self._report = report
        self._unplaced: set[str] = set()

    def of(self, frame: str, pose_frame_laser: tuple[float, ...] | None = None) -> Mounting:
        """The mounting of the laser with this frame; see `LaserRecord.pose_frame_laser`."""
        if self._options.pose_base_laser is not None:
            return Mounting(self._options.pose_base_laser, self._options.laser_flipped)
        inner = None
        if pose_frame_laser is not None and not is_world(frame):
            inner = matrix_of(pose_frame_laser[:3], pose_frame_laser[3:])
        outer = self._outer(frame, is_posed=inner is not None and not _is_identity(inner))
        mounting = mounting_of(outer if inner is None else outer @ inner)
        if mounting.is_tilted:
            tilt_deg = math.degrees(mounting.tilt_rad)
            self._report.tilt_deg = max(self._report.tilt_deg, tilt_deg)
            self._report.warn(
                f"{frame} is tilted by {tilt_deg:.0f} degrees: its scans"
                " are taken as if they were level",
                finding="tilt",
            )
        return mounting

    def take_late(self, records: list[TransformRecord]) -> None:
        """Tell the user of a place that comes when the laser was taken to be the base."""
        if not self._unplaced:
            return
        for record in records:
            self._tree.add(record)
        for frame in sorted(self._unplaced):
            base = self._base_frame or self._tree.likely_base(frame)
            matrix = None if base is None else self._tree.matrix(base, frame)
            if matrix is not None:
                self._unplaced.discard(frame)
                self._report.warn(
                    f"the place of '{frame}' on {base} comes only after the first scans and is not"
                    f" used: give --laser-pose {_as_flag(mounting_of(matrix))}"
                )

    def _outer(self, frame: str, *, is_posed: bool) -> Matrix:
        base = self._base_frame
        if base is None:
            base = frame if is_base(frame) else self._tree.likely_base(frame)
        matrix = None if base is None else self._tree.matrix(base, frame)
        if base is None or matrix is None:
            if not is_posed:
                self._unplaced.add(frame)
                self._report.places_unknown = True
                self._report.warn(_taken_as_base(frame, base), finding="mounting")
            return np.eye(4)
        if self._tree.moves(base, frame):
            self._report.places_move = True
            self._report.warn(
                f"{frame} moves on {base}: its first place is used for the whole log",
                finding="moving laser",
            )
        return matrix


def _as_flag(mounting: Mounting) -> str:
    pose = mounting.pose_base_laser
    flip = ",flip" if mounting.upside_down else ""
    return f"{pose.x:.4g},{pose.y:.4g},{math.degrees(pose.theta):.4g}{flip}"


def _is_identity(matrix: Matrix) -> bool:
    return bool(np.allclose(matrix, np.eye(4), rtol=0.0, atol=1e-9))


def _taken_as_base(frame: str, base: str | None) -> str:
    missing = f" from {base}" if base else ""
    laser = f"'{frame}', the frame of the scans," if frame else "the laser"
    unknown = f"no transform{missing} to {laser} in the log"
    return f"{unknown}: the laser is taken to be the base{TELL_PLACE}"
