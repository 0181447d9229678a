"""The common case of tracking, in one compiled call: predict, register, judge.

A scan that lies where it was expected needs the finest level alone. In the 100 microseconds that
this takes, each small step made from Python would count.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bsmap_cli.geometry.compiled import kernel
from bsmap_cli.geometry.compiled_poses import Pose, as_pose, composed, relative
from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.slam.keyframes import KeyframeRule, is_keyframe, keyframe_rule
from bsmap_cli.slam.prediction import (
    Motion,
    MotionRule,
    Prediction,
    motion_rule,
    moved_on,
    predict,
    worst_sigma_m,
)
from bsmap_cli.slam.registration import Gates, RegistrationResult, gates_of, gauss_newton

if TYPE_CHECKING:
    from bsmap_cli.slam.slam_settings import SlamSettings


class Followed(NamedTuple):
    """What came of following a scan on the finest level.

    plain : it lies where it was expected, and walls say so in all directions. Only then pose,
    motion and due are those after this scan; else they are those before.
    prediction, match : what was expected, and what was found, its pose in the submap's frame; no
    match where scans are registered by another method.
    due : the base has moved far enough for a keyframe.
    """

    plain: bool
    pose_local: SE2
    motion: Motion
    prediction: Prediction
    match: RegistrationResult | None
    due: bool


@kernel
def _follow(
    arrays: tuple[Any, ...],
    matrix: Points,
    knot_step_m: float,
    points: Points,
    tangents: Points,
    counts: Vector,
    sigma_m: float,
    last_motion: tuple[Any, ...],
    rules: tuple[Any, ...],
    odometry: Pose,
    elapsed_s: float,
    origin: Pose,
    last: Pose,
    last_keyframe: Pose,
    enough: float,
    pose: Vector,
    hessian: Points,
) -> tuple[bool, bool, Pose, Any, Any, float, float, int, int]:
    """Plain and due, pose, motion, prediction; of the match inliers, rms, steps and degenerate.

    Level, motion and rules come and go as plain tuples, which are handed over three times as fast.
    """
    motion, rule = Motion(*last_motion), MotionRule(*rules[0])
    prediction = predict(motion, odometry, elapsed_s, rule)
    expected, information, tally = np.empty(3), np.zeros((3, 3)), np.empty(5)
    start = composed(relative(last, origin), prediction.step)
    for i in range(3):
        expected[i] = pose[i] = start[i]
    information[0, 0] = information[1, 1] = 1.0 / (prediction.sigma_m * prediction.sigma_m)
    information[2, 2] = 1.0 / (prediction.sigma_rad * prediction.sigma_rad)
    steps, degenerate = gauss_newton(
        LevelArrays(*arrays),
        matrix,
        knot_step_m,
        points,
        tangents,
        counts,
        sigma_m,
        pose,
        expected,
        information,
        Gates(*rules[1]),
        hessian,
        tally,
    )
    ratio = tally[0] / max(len(points), 1)
    rms_m = np.sqrt(tally[1] / max(tally[0], 1.0))
    plain = ratio >= enough and degenerate == 0
    due = False
    here = last
    if plain:
        here = composed(origin, (pose[0], pose[1], pose[2]))
        step = relative(here, last)
        motion = moved_on(motion, step, odometry, True, worst_sigma_m(hessian), rule)
        due = is_keyframe(relative(here, last_keyframe), KeyframeRule(*rules[2]))
    return plain, due, here, tuple(motion), tuple(prediction), ratio, rms_m, steps, degenerate


class Follower:
    """What following a scan needs and does not change from one to the next."""

    def __init__(self, settings: SlamSettings) -> None:
        unit = settings.ladder[-1]
        self.motion_rule = motion_rule(settings.prediction, unit)
        self.keyframe_rule = keyframe_rule(settings.keyframes, unit)
        self._registration = settings.registration
        self._unit = unit
        self._rules: tuple[float, tuple[Any, ...]] = (-1.0, ())

    def follow(
        self,
        level: CurveMap,
        clusters: Clusters,
        motion: Motion,
        odometry: Pose,
        elapsed_s: float,
        *,
        origin: SE2,
        last: SE2,
        last_keyframe: SE2,
        enough: float,
        sigma_m: float,
    ) -> Followed:
        """Predict the next scan's pose from the last one and register it on the finest level.

        origin, last, last_keyframe : poses in the local frame, of the level, the base at the last
        scan and at the last keyframe. enough : share of its points that must lie on the level; of
        infinity no scan is plain.
        """
        if self._registration.method != "points":
            prediction = predict(motion, odometry, elapsed_s, self.motion_rule)
            return Followed(False, last, motion, prediction, None, False)
        if self._rules[0] != sigma_m:
            gates = gates_of(self._registration, self._unit, sigma_m)
            rules = tuple(self.motion_rule), tuple(gates), tuple(self.keyframe_rule)
            self._rules = sigma_m, rules
        pose, hessian = np.empty(3), np.empty((3, 3))
        plain, due, here, moved, expected, ratio, rms_m, steps, degenerate = _follow(
            tuple(level.arrays),
            level.matrix,
            level.knot_step_m,
            clusters.points,
            clusters.tangents,
            clusters.counts,
            sigma_m,
            tuple(motion),
            self._rules[1],
            odometry,
            elapsed_s,
            as_pose(origin),
            as_pose(last),
            as_pose(last_keyframe),
            enough,
            pose,
            hessian,
        )
        match = RegistrationResult(
            pose, hessian, ratio, rms_m, steps, degenerate, len(clusters.points)
        )
        return Followed(plain, SE2(*here), Motion(*moved), Prediction(*expected), match, due)
