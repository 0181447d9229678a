"""The scans that change the map."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from bsmap_cli.geometry.compiled import inlined
from bsmap_cli.geometry.compiled_poses import Pose
from bsmap_cli.geometry.kernels import magnitude
from bsmap_cli.geometry.se2 import SE2, Vector
from bsmap_cli.mapping.compact_clusters import CompactClusters
from bsmap_cli.sensor.sight import Sight
from bsmap_cli.settings import setting


@dataclass(frozen=True, slots=True, kw_only=True)
class KeyframeSettings:
    """When a scan enters the map. Standing still must not saturate the weights."""

    distance: float = setting(2.0, "way since the last keyframe [finest knot steps]", minimum=0.0)
    angle_deg: float = setting(7.0, "turn since the last keyframe", minimum=0.0)
    overlap: float = setting(
        0.8,
        "a scan that has less than this share on the map of what scans had on it since the last "
        "keyframe is one, too: through a door, a step shows a room",
        minimum=0.0,
        maximum=1.0,
    )


class KeyframeRule(NamedTuple):
    """Way and turn that make a keyframe, for compiled code."""

    distance_m: float
    angle_rad: float


def keyframe_rule(settings: KeyframeSettings, finest_step_m: float) -> KeyframeRule:
    """The settings for a map of this knot step."""
    return KeyframeRule(settings.distance * finest_step_m, math.radians(settings.angle_deg))


@dataclass(slots=True)
class Keyframe:
    """One scan of the map.

    scan_index : its place in the trajectory. pose_local : (3,) where tracking saw the base, in
    the drifting local frame. submap : index of the submap it was matched against.
    information : (3, 3) of that match. coasted_m, coasted_rad : what the way and the turn from the
    last keyframe may be off because no wall told. weak : tracking had lost the map here.
    explained : share of its points that lay on the map it was tracked on. sight : what the scan
    looked through, where that is asked for.
    """

    index: int
    scan_index: int
    pose_local: SE2
    clusters: CompactClusters
    submap: int
    information: Vector
    coasted_m: float
    coasted_rad: float
    weak: bool
    explained: float
    sight: Sight | None = None


def every_nth(knot_step_m: float, finest_step_m: float) -> int:
    """Which keyframes a coarser level needs: their distance is set for the finest."""
    return max(1, round(knot_step_m / finest_step_m))


@inlined
def is_keyframe(step: Pose, rule: KeyframeRule) -> bool:
    """Has the base moved or turned enough since the last keyframe? With 0, every scan has."""
    return magnitude(step[0], step[1]) >= rule.distance_m or abs(step[2]) >= rule.angle_rad
