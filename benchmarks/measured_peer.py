"""Odometry of another program on planar scans, measured in a process of its own.

python benchmarks/measured_peer.py PEER SCANS.npz POSES.npy

Needs numpy and the peer alone, so that it runs in an environment of its own. SCANS.npz holds
points (n, 3) float64 of all returns in the base frame, z = 0, starts (scans + 1,), and guesses
(scans, 4, 4): the step that odometry saw, or nothing. Only the calls of the peer are timed.
"""

from __future__ import annotations

import gc
import json
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from runpy import run_path
from time import perf_counter
from typing import Any

import numpy as np

PEAK_MEMORY = Path(__file__).parent.parent / "bsmap_cli" / "pipeline" / "peak_memory.py"
VOXEL_M = 0.2
Step = Callable[[Any, Any], Any]  # points (n, 3) and the guessed step (4, 4) or None: the pose


def kiss_icp(reach_m: float) -> Step:
    """KISS-ICP on one thread; a guess takes the place of its constant velocity."""
    from kiss_icp.config import KISSConfig
    from kiss_icp.kiss_icp import KissICP

    config = KISSConfig()
    config.data.max_range, config.data.min_range, config.data.deskew = reach_m, 0.0, False
    config.mapping.voxel_size = VOXEL_M
    config.registration.max_num_threads = 1
    odometry = KissICP(config)
    none = np.zeros(0)

    def step(points: Any, guess: Any) -> Any:
        if guess is not None:
            odometry.last_delta = guess
        odometry.register_frame(points, none)
        return odometry.last_pose

    return step


def small_gicp(reach_m: float, layers_m: float = 0.0) -> Step:
    """VGICP of each scan against a voxel map that grows, as in its example, on one thread.

    layers_m : the scan is also put so far above and below itself. The covariances of flat points
    know no walls, as the thinnest direction is always up; three layers make walls of them, which
    drifts less and takes longer.
    """
    import small_gicp as gicp

    voxels = gicp.GaussianVoxelMap(2.5 * VOXEL_M)
    voxels.set_lru(horizon=200, clear_cycle=10)
    pose, last_step, begun = np.eye(4), np.eye(4), False
    up = np.array([0.0, 0.0, layers_m])

    def step(points: Any, guess: Any) -> Any:
        nonlocal pose, last_step, begun
        if layers_m:
            points = np.concatenate([points + k * up for k in (-1.0, 0.0, 1.0)])
        cloud, _ = gicp.preprocess_points(points, downsampling_resolution=0.5 * VOXEL_M)
        if begun:
            predicted = pose @ (last_step if guess is None else guess)
            found = gicp.align(
                voxels,
                cloud,
                init_T_target_source=predicted,
                max_correspondence_distance=2.5 * VOXEL_M,
            ).T_target_source
            pose, last_step = found, np.linalg.inv(pose) @ found
        voxels.insert(cloud, pose)
        begun = True
        return pose

    return step


def small_gicp_layers(reach_m: float) -> Step:
    """VGICP of each scan in three layers."""
    return small_gicp(reach_m, layers_m=0.5 * VOXEL_M)


PEERS = {"kiss-icp": kiss_icp, "small_gicp": small_gicp, "small_gicp, 3 layers": small_gicp_layers}


def main() -> None:
    """Run one peer; write (scans, 3) poses, print seconds and memory."""
    gc.set_threshold(50_000, 50, 50)  # as `bsmap` has it
    peer, scans, poses = sys.argv[1:]
    with np.load(scans) as held:
        points, starts, guesses = held["points"], held["starts"], held["guesses"]
    reach_m = float(np.abs(points).max()) * 1.5
    clouds = [points[a:b] for a, b in pairwise(starts)]
    for warm in (True, False):
        step = PEERS[peer](reach_m)
        found = np.empty((len(clouds), 3))
        used = clouds[:50] if warm else clouds
        began = perf_counter()
        for k, cloud in enumerate(used):
            pose = step(cloud, guesses[k] if len(guesses) else None)
            found[k] = pose[0, 3], pose[1, 3], np.arctan2(pose[1, 0], pose[0, 0])
        seconds = perf_counter() - began
    np.save(poses, found)
    peak_mb = run_path(str(PEAK_MEMORY))["peak_memory_mb"]()  # bsmap itself is not installed here
    print(json.dumps({"seconds": seconds, "peak_memory_mb": round(peak_mb, 1)}))


if __name__ == "__main__":
    main()
