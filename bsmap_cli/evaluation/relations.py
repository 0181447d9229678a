"""Errors against verified relations between poses: Kuemmerle et al. 2009, in the plane."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.errors import LogError
from bsmap_cli.evaluation.pose_arrays import Poses, nearest_stamps, relative_poses, wrap_angles
from bsmap_cli.geometry.se2 import Vector
from bsmap_cli.sensor.stamps import parse_stamp
from bsmap_cli.sensor.trajectory import Trajectory

MAX_DT_NS = 100_000_000


@dataclass(frozen=True, slots=True)
class Relations:
    """first_ns, second_ns : (m,) stamps; poses : (m, 3) the second pose in the first's frame."""

    first_ns: NDArray[np.int64]
    second_ns: NDArray[np.int64]
    poses: Poses

    def __len__(self) -> int:
        return len(self.poses)


@dataclass(frozen=True, slots=True, kw_only=True)
class RelationErrors:
    """Errors of the relations that have poses at both ends, in their order.

    rows : (m,) index of each into the relations; translation_m, rotation_deg : (m,), not negative.
    """

    relations: int
    rows: NDArray[np.int64]
    translation_m: Vector
    rotation_deg: Vector

    def as_json(self) -> dict[str, Any]:
        """What `eval --relations --json` adds; the standard deviation is the population's."""
        return {
            "translation": _mean_std(self.translation_m, "m"),
            "rotation": _mean_std(self.rotation_deg, "deg"),
            "relations": self.relations,
            "matched": len(self.rows),
        }


def parse_relations(lines: Iterable[str]) -> Relations:
    """Relations from lines `t1 t2 x y z roll pitch yaw`; LogError names a line that is none."""
    stamps: list[tuple[int, int]] = []
    poses: list[tuple[float, float, float]] = []
    for number, line in enumerate(lines, 1):
        fields = line.partition("#")[0].split()
        if not fields:
            continue
        try:
            x, y, _, _, _, yaw = map(float, fields[2:])
            first, second = map(parse_stamp, fields[:2])
            if not np.isfinite((x, y, yaw)).all():
                raise ValueError("a number is not finite")
        except ValueError as error:
            raise LogError(
                f"line {number} of the relations is not `t1 t2 x y z roll pitch yaw`: {error}"
            ) from error
        stamps.append((first, second))
        poses.append((x, y, yaw))
    times = np.array(stamps, np.int64).reshape(-1, 2)
    return Relations(times[:, 0], times[:, 1], np.array(poses, np.float64).reshape(-1, 3))


def relation_errors(trajectory: Trajectory, relations: Relations) -> RelationErrors:
    """Compare each relation with the motion between the nearest poses within 0.1 s of its stamps.

    With d = inverse(P(t1)) P(t2): hypot(d.x - x, d.y - y) and |wrap(d.yaw - yaw)|.
    LogError where the trajectory has no pose, or no relation is met.
    """
    if len(trajectory) == 0:
        raise LogError("the trajectory has no poses to compare with relations")
    first, first_off = nearest_stamps(trajectory.stamps_ns, relations.first_ns)
    second, second_off = nearest_stamps(trajectory.stamps_ns, relations.second_ns)
    rows = np.flatnonzero((first_off <= MAX_DT_NS) & (second_off <= MAX_DT_NS))
    if len(rows) == 0:
        raise LogError(
            "no relation has poses within 0.1 s of both its stamps:"
            " are trajectory and relations of the same log?"
        )
    motion = relative_poses(trajectory.poses[first[rows]], trajectory.poses[second[rows]])
    off = motion - relations.poses[rows]
    return RelationErrors(
        relations=len(relations),
        rows=rows,
        translation_m=np.hypot(off[:, 0], off[:, 1]),
        rotation_deg=np.degrees(np.abs(wrap_angles(off[:, 2]))),
    )


def _mean_std(values: Vector, unit: str) -> dict[str, float]:
    return {f"mean_{unit}": float(values.mean()), f"std_{unit}": float(values.std())}
