"""How far a trajectory is from a reference: absolute (ATE) and relative (RPE) pose error."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.errors import LogError
from bsmap_cli.evaluation.pose_arrays import (
    Poses,
    nearest_stamps,
    relative_poses,
    transform_poses,
    wrap_angles,
)
from bsmap_cli.geometry.se2 import SE2, Vector
from bsmap_cli.sensor.trajectory import Trajectory

STANDING_M = 0.05  # [m] rms: positions spread less say nothing about the rotation


@dataclass(frozen=True, slots=True, kw_only=True)
class MatchedPoses:
    """Poses of an estimate and a reference at about the same times, in the order of the log."""

    stamps_ns: NDArray[np.int64]
    estimate: Poses
    reference: Poses


@dataclass(frozen=True, slots=True, kw_only=True)
class AbsoluteError:
    """Errors of the aligned estimate, one a pose: distance [m] and angle [deg].

    pose_reference_estimate : the alignment.
    """

    pose_reference_estimate: SE2
    stamps_ns: NDArray[np.int64]
    translation_m: Vector
    rotation_deg: Vector

    def as_json(self) -> dict[str, float]:
        """The `ate` of `eval --json`."""
        return {
            "rmse_m": rms(self.translation_m),
            "mean_m": float(self.translation_m.mean()),
            "median_m": float(np.median(self.translation_m)),
            "max_m": float(self.translation_m.max()),
            "rotation_rmse_deg": rms(self.rotation_deg),
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class RelativeError:
    """Errors of motions of `delta_m` travelled metres each; no rows where the way is shorter."""

    delta_m: float
    translation_m: Vector
    rotation_deg: Vector

    def as_json(self) -> dict[str, Any]:
        """The `rpe` of `eval --json`; null where there is nothing to measure."""
        some = len(self.translation_m) > 0
        return {
            "per": f"{self.delta_m:g} m",
            "rmse_m": rms(self.translation_m) if some else None,
            "mean_m": float(self.translation_m.mean()) if some else None,
            "rmse_deg": rms(self.rotation_deg) if some else None,
        }


def rms(values: Vector) -> float:
    """Root mean square."""
    return math.sqrt(float(np.mean(np.square(values))))


def match_poses(
    estimate: Trajectory, reference: Trajectory, *, max_dt_s: float = 0.02
) -> MatchedPoses:
    """Give each pose of the shorter trajectory the nearest one of the other, within `max_dt_s`.

    LogError where none match.
    """
    swap = len(estimate) > len(reference)
    few, many = (reference, estimate) if swap else (estimate, reference)
    if len(few) == 0:
        raise LogError("a trajectory without poses cannot be compared")
    rows, off_ns = nearest_stamps(many.stamps_ns, few.stamps_ns)
    near = off_ns <= round(max_dt_s * 1e9)
    if not near.any():
        raise LogError(
            f"no poses within {max_dt_s} s of each other, the nearest are"
            f" {off_ns.min() * 1e-9:.3f} s apart: compare runs of one log, or raise --max-dt"
        )
    pair = (few.poses[near], many.poses[rows[near]])
    return MatchedPoses(
        stamps_ns=few.stamps_ns[near],
        estimate=pair[1] if swap else pair[0],
        reference=pair[0] if swap else pair[1],
    )


def align(matched: MatchedPoses) -> SE2:
    """pose_reference_estimate: the rigid motion of least squared distance between positions.

    Where the robot stands or turns on the spot, positions do not tell the rotation, and the mean
    difference of the headings takes their place.
    """
    estimate, reference = matched.estimate, matched.reference
    centre_e, centre_r = estimate[:, :2].mean(axis=0), reference[:, :2].mean(axis=0)
    (ex, ey), (rx, ry) = (estimate[:, :2] - centre_e).T, (reference[:, :2] - centre_r).T
    if rms(np.hypot(rx, ry)) > STANDING_M:
        theta = math.atan2(float(np.sum(ex * ry - ey * rx)), float(np.sum(ex * rx + ey * ry)))
    else:
        turn = reference[:, 2] - estimate[:, 2]
        theta = math.atan2(float(np.sin(turn).sum()), float(np.cos(turn).sum()))
    x, y = centre_r - SE2(0.0, 0.0, theta).transform(centre_e)
    return SE2.from_array((x, y, theta))


def absolute_error(matched: MatchedPoses, alignment: SE2 | None = None) -> AbsoluteError:
    """ATE: distance and angle of each pose after alignment, by least squares if none is given."""
    motion = align(matched) if alignment is None else alignment
    moved = transform_poses(motion, matched.estimate)
    off = moved - matched.reference
    return AbsoluteError(
        pose_reference_estimate=motion,
        stamps_ns=matched.stamps_ns,
        translation_m=np.hypot(off[:, 0], off[:, 1]),
        rotation_deg=np.degrees(np.abs(wrap_angles(off[:, 2]))),
    )


def relative_error(matched: MatchedPoses, *, delta_m: float = 1.0) -> RelativeError:
    """RPE: from each pose to the first that the reference reaches after `delta_m` more metres."""
    steps = np.diff(matched.reference[:, :2], axis=0)
    travelled = np.concatenate(([0.0], np.cumsum(np.hypot(steps[:, 0], steps[:, 1]))))
    ends = np.searchsorted(travelled, travelled + delta_m - 1e-9)
    first = np.flatnonzero(ends < len(travelled))
    last = ends[first]
    done = relative_poses(matched.reference[first], matched.reference[last])
    claimed = relative_poses(matched.estimate[first], matched.estimate[last])
    off = relative_poses(done, claimed)
    return RelativeError(
        delta_m=delta_m,
        translation_m=np.hypot(off[:, 0], off[:, 1]),
        rotation_deg=np.degrees(np.abs(off[:, 2])),
    )
