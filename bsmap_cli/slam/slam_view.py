"""How a run stands between two scans: what a viewer may look at, and does not change."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.slam.keyframes import Keyframe
from bsmap_cli.slam.local_slam import LocalSlam
from bsmap_cli.slam.submap import Submap


@dataclass(frozen=True, slots=True)
class SlamView:
    """Submaps and keyframes so far, and where the graph puts them by now.

    poses_map_submap : one for each submap. pose_map_base : of the last scan.
    """

    submaps: Sequence[Submap]
    keyframes: Sequence[Keyframe]
    poses_map_submap: Sequence[SE2]
    pose_map_base: SE2

    def path(self, first: int = 0) -> list[SE2]:
        """The keyframes from `first` on, in the map frame."""
        return [
            self.poses_map_submap[frame.submap]
            @ self.submaps[frame.submap].to_submap(frame.pose_local)
            for frame in self.keyframes[first:]
        ]


def view_of(local: LocalSlam, known: Points, pose_local: SE2) -> SlamView:
    """The view of a run whose graph knows the (n, 3) poses of its first submaps, or of none."""
    poses = [SE2.from_array(pose) for pose in known] or [local.submaps[0].pose_local]
    for k in range(len(poses), len(local.submaps)):
        poses.append(poses[-1] @ local.submaps[k - 1].to_submap(local.submaps[k].pose_local))
    pose_map_base = poses[local.finished] @ local.older.to_submap(pose_local)
    return SlamView(local.submaps, local.keyframes, poses, pose_map_base)
