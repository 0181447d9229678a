"""All keyframes and submaps in one graph, solved once the log has ended."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.slam.edges import EdgeList
from bsmap_cli.slam.local_slam import LocalSlam
from bsmap_cli.slam.loop_closure import Loop
from bsmap_cli.slam.pose_graph import REJECTED, optimise
from bsmap_cli.slam.uncertainty import isotropic_information, match_information, way_deviation


@dataclass(frozen=True, slots=True)
class Anchor:
    """A keyframe seen from a map that is there already; information in the frame of that map."""

    keyframe: int
    pose_map_base: SE2
    information: Points


def solve_full_graph(
    local: LocalSlam,
    loops: list[Loop],
    *,
    anchors: Sequence[Anchor] = (),
    start: Points | None = None,
) -> tuple[Points, int]:
    """(n, 3) poses of all keyframes in the map frame, and how many loops proved wrong.

    Nodes: keyframes first, submaps behind them. A keyframe hangs on every submap that it is part
    of, a loop on the submap it found again, and neighbours on each other by tracking, which alone
    holds what no wall says. With anchors a map that is there already is the first node, held
    fixed, and the poses, from (n, 3) `start`, are in its frame.
    """
    keyframes, submaps = local.keyframes, local.submaps
    unit = local.settings.ladder[-1]
    count = len(keyframes)
    first = 1 if anchors else 0
    nodes_of_submaps = first + count
    # the keyframes that two submaps share err alike: together they count as one observation
    shared = max(1, local.settings.submaps.keyframes // 2)
    informations = np.array([frame.information for frame in keyframes])
    told = np.any(informations, axis=(1, 2))
    matched = match_information(informations, unit) / shared
    near = isotropic_information(way_deviation(0.0, unit)) / shared
    edges = EdgeList()
    for submap in submaps:
        for k in submap.keyframes:
            if k != submap.keyframes[0] and not told[k]:
                continue  # it coasted, and lies in the submap no better than its neighbours know
            pose = submap.to_submap(keyframes[k].pose_local)
            information = matched[k] if keyframes[k].submap == submap.index and told[k] else near
            node = nodes_of_submaps + submap.index
            edges.add(node, first + k, pose.as_array(), information, loop=False)
    for k in range(1, count):
        step = keyframes[k].pose_local.relative_to(keyframes[k - 1].pose_local)
        way = math.hypot(step.x, step.y)
        deviation = way_deviation(
            way,
            unit,
            coasted_m=keyframes[k].coasted_m,
            coasted_rad=keyframes[k].coasted_rad,
            weak=keyframes[k].weak,
        )
        edges.add(
            first + k - 1, first + k, step.as_array(), isotropic_information(deviation), loop=False
        )
    for loop in loops:
        edges.add(
            nodes_of_submaps + loop.submap,
            first + loop.keyframe,
            loop.pose_submap_base.as_array(),
            loop.information,
            loop=True,
        )
    for anchor in anchors:
        seen = anchor.pose_map_base.as_array()
        edges.add(0, first + anchor.keyframe, seen, anchor.information, loop=True)
    solved = optimise(_starting_poses(local, start, anchored=bool(anchors)), edges)
    rejected = int((solved.loop_weights[: len(loops)] < REJECTED).sum())
    return solved.poses[first:nodes_of_submaps], rejected


def _starting_poses(local: LocalSlam, start: Points | None, *, anchored: bool) -> Points:
    """All nodes as tracking left them, or keyframes at `start` and submaps with their first one."""
    keyframes, submaps = local.keyframes, local.submaps
    poses = [SE2.identity()] if anchored else []
    if start is None:
        poses += [frame.pose_local for frame in keyframes]
        poses += [submap.pose_local for submap in submaps]
    else:
        poses += [SE2.from_array(pose) for pose in start]
        for submap in submaps:
            if not submap.keyframes:  # begun with the last keyframe
                poses.append(SE2.identity())
                continue
            first = submap.keyframes[0]
            seen = submap.to_submap(keyframes[first].pose_local)
            poses.append(SE2.from_array(start[first]) @ seen.inverse())
    return np.array([pose.as_array() for pose in poses])
