"""All keyframes and submaps in one graph, solved once the log has ended."""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.geometry.se2 import Points
from bsmap_cli.slam.local_slam import LocalSlam
from bsmap_cli.slam.loop_closure import Loop
from bsmap_cli.slam.pose_graph import REJECTED, EdgeList, optimise
from bsmap_cli.slam.uncertainty import isotropic_information, match_information, way_deviation


def solve_full_graph(local: LocalSlam, loops: list[Loop]) -> tuple[Points, int]:
    """(n, 3) poses of all keyframes in the map frame, and how many loops proved wrong.

    Nodes: keyframes first, submaps behind them. A keyframe hangs on every submap that it is part
    of, a loop on the submap it found again, and neighbours on each other by tracking, which alone
    holds what no wall says.
    """
    keyframes, submaps = local.keyframes, local.submaps
    unit = local.settings.ladder[-1]
    count = len(keyframes)
    # the keyframes that two submaps share err alike: together they count as one observation
    shared = max(1, local.settings.submaps.keyframes // 2)
    edges = EdgeList()
    for submap in submaps:
        for k in submap.keyframes:
            pose = submap.to_submap(keyframes[k].pose_local)
            information = isotropic_information(way_deviation(0.0, unit))
            if keyframes[k].submap == submap.index and np.any(keyframes[k].information):
                information = match_information(keyframes[k].information, unit, frame_rad=0.0)
            edges.add(count + submap.index, k, pose.as_array(), information / shared, loop=False)
    for k in range(1, count):
        step = keyframes[k - 1].pose_local.inverse() @ keyframes[k].pose_local
        way = math.hypot(step.x, step.y)
        deviation = way_deviation(
            way, unit, coasted_m=keyframes[k].coasted_m, weak=keyframes[k].weak
        )
        edges.add(k - 1, k, step.as_array(), isotropic_information(deviation), loop=False)
    for loop in loops:
        edges.add(
            count + loop.submap,
            loop.keyframe,
            loop.pose_submap_base.as_array(),
            loop.information,
            loop=True,
        )
    start = [frame.pose_local.as_array() for frame in keyframes]
    start += [submap.pose_local.as_array() for submap in submaps]
    solved = optimise(np.array(start), edges)
    return solved.poses[:count], int((solved.loop_weights < REJECTED).sum())
