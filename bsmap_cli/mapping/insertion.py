"""Insert the clusters of one scan into one level of the map: Algorithm 1, lines 3.1 to 4.2.1."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import kernel, part
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.association import match_points
from bsmap_cli.mapping.compact_clusters import BATCH, CompactClusters, unpack_scans
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.least_surface import LeastSurface
from bsmap_cli.mapping.level_arrays import LevelArrays
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.run_merging import merge_runs
from bsmap_cli.mapping.runs import plan_runs
from bsmap_cli.mapping.scan_batch import ScanBatch
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.mapping.tracked_insertion import insert_tracked


def rotate(pose: Vector, vectors: Points) -> Points:
    """(n, 2) directions of the inner frame, in the outer one."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return np.asarray(vectors @ np.array([[cos, sin], [-sin, cos]]))


class ScanRoom(NamedTuple):
    """Where a scan lies in the map, and its runs: room for the largest one of a batch.

    done : (3,) scans inserted; of the next one runs merged, and all of them, -1 before it is cut.
    """

    points: Points
    tangents: Points
    curves: NDArray[np.int64]
    u: Vector
    runs: NDArray[np.int64]
    done: NDArray[np.int64]


def scan_room(n: int) -> ScanRoom:
    """For scans of so many points."""
    return ScanRoom(
        np.empty((n, 2)),
        np.empty((n, 2)),
        np.empty(n, np.int64),
        np.empty(n),
        np.empty((2 * n + 2, 5), np.int64),
        np.array([0, 0, -1]),
    )


@part
def _place_and_plan(
    level: LevelArrays,
    matrix: Points,
    knot_step_m: float,
    points_body: Points,
    tangents_body: Points,
    starts: NDArray[np.int64],
    pose: Vector,
    gate_m: float,
    least: LeastSurface,
    room: ScanRoom,
) -> int:
    """Place the scan, eq. (2), match its points and cut it into runs; their number."""
    n = len(points_body)
    points, tangents, u = room.points[:n], room.tangents[:n], room.u[:n]
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    for j in range(n):
        points[j, 0] = cos * points_body[j, 0] - sin * points_body[j, 1] + pose[0]
        points[j, 1] = sin * points_body[j, 0] + cos * points_body[j, 1] + pose[1]
        tangents[j, 0] = cos * tangents_body[j, 0] - sin * tangents_body[j, 1]
        tangents[j, 1] = sin * tangents_body[j, 0] + cos * tangents_body[j, 1]
        u[j] = 0.0
    match_points(
        level,
        matrix,
        knot_step_m,
        points,
        tangents,
        starts,
        gate_m,
        room.curves,
        u,
    )
    return plan_runs(level, points, starts, room.curves, u, knot_step_m, least, room.runs)


@kernel
def _insert(
    arrays: tuple[Any, ...],
    matrix: Points,
    knot_step_m: float,
    points_body: Points,
    tangents_body: Points,
    starts: NDArray[np.int64],
    firsts: NDArray[np.int64],
    poses: Points,
    gate_m: float,
    least_surface: tuple[Any, ...],
    max_weight: float,
    penalty: float,
    first_penalty: float,
    roughest_m: float,
    by_table: bool,
    working_room: tuple[Any, ...],
) -> bool:
    """Insert scan after scan, from where `room.done` tells; False where a run finds no room.

    Level, least surface and room come as plain tuples, which are handed over three times as fast.
    """
    level, least = LevelArrays(*arrays), LeastSurface(*least_surface)
    room = ScanRoom(*working_room)
    done = room.done
    while done[0] < len(poses):
        s = done[0]
        begin, end = starts[firsts[s]], starts[firsts[s + 1]]
        n = end - begin
        if done[2] < 0:
            bounds = starts[firsts[s] : firsts[s + 1] + 1] - begin
            done[1] = 0
            done[2] = _place_and_plan(
                level,
                matrix,
                knot_step_m,
                points_body[begin:end],
                tangents_body[begin:end],
                bounds,
                poses[s],
                gate_m,
                least,
                room,
            )
        done[1] = merge_runs(
            level,
            matrix,
            knot_step_m,
            room.runs[: done[2]],
            done[1],
            room.curves[:n],
            room.u[:n],
            room.points[:n],
            room.tangents[:n],
            max_weight,
            penalty,
            first_penalty,
            roughest_m,
            by_table,
        )
        if done[1] < done[2]:
            return False
        done[0] += 1
        done[2] = -1
    return True


def insert_scans(
    curve_map: CurveMap,
    scans: ScanBatch,
    poses_map_body: Points,
    settings: MappingSettings,
) -> None:
    """Match, fit and merge scan after scan; frame of the map = frame of the (s, 3) poses."""
    if settings.association.method == "centroid":
        for clusters, pose in zip(scans, poses_map_body, strict=True):
            points = rotate(pose, clusters.points) + pose[:2]  # eq. (2)
            insert_tracked(curve_map, points, clusters.starts, settings)
        return
    clusters, step = scans.clusters, curve_map.knot_step_m
    room = scan_room(scans.most_points)
    while not _insert(
        tuple(curve_map.arrays),
        curve_map.matrix,
        step,
        clusters.points,
        clusters.tangents,
        clusters.starts,
        scans.firsts,
        poses_map_body,
        settings.association.track_dist * step,
        tuple(settings.segmentation.least(step)),
        float(settings.merging.max_weight),
        settings.fitting.penalty,
        settings.fitting.first_penalty,
        settings.merging.roughest * step,
        settings.merging.method == "table",
        tuple(room),
    ):
        curve_map.reserve(int(curve_map.arrays.sizes[3]))


def insert_clusters(
    curve_map: CurveMap,
    clusters: Clusters,
    pose_map_body: Vector,
    settings: MappingSettings,
) -> None:
    """Insert one scan; frame of the map = frame of the pose."""
    insert_scans(curve_map, ScanBatch.of_one(clusters), pose_map_body[None], settings)


def draw_scans(
    curve_map: CurveMap,
    packed: Sequence[CompactClusters],
    poses_map_body: Points,
    settings: MappingSettings,
    sigma_m: float,
    *,
    above: int = 0,
    fewest: int = 0,
) -> None:
    """Insert packed scans into a map of the finest knot step, or of the one so many `above` it.

    fewest : clusters of fewer raw returns stay away.
    """
    ladder, thinning = settings.ladder, settings.fitting.thinning
    poses = np.ascontiguousarray(poses_map_body)  # one layout for the compiler
    for begin in range(0, len(packed), BATCH):
        part = slice(begin, begin + BATCH)
        scans = unpack_scans(packed[part], ladder[-1], sigma_m, fewest=fewest)
        for step in ladder[-2 : -2 - above : -1]:
            scans = scans.coarser(step, thinning * step, sigma_m)
        insert_scans(curve_map, scans, poses[part], settings)
