"""The two ways from a log to a map: with known poses, and without."""

from __future__ import annotations

from array import array
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from itertools import chain
from time import perf_counter
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from bsmap_cli import __version__
from bsmap_cli.beside import usable_cores
from bsmap_cli.config import Settings, settings_as_dict
from bsmap_cli.errors import ConfigError, LogError
from bsmap_cli.evaluation.pose_arrays import transform_poses
from bsmap_cli.geometry.se2 import SE2, wrap_angle
from bsmap_cli.logs.reader import LogReader
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.mapper import Mapper
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.pipeline.compile_ahead import compile_for_slam
from bsmap_cli.pipeline.feed import Feed, Onlooker, Progress, Silent
from bsmap_cli.pipeline.memory_needed import refuse_too_large
from bsmap_cli.sensor.pose_track import PoseTrack
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.trajectory import Trajectory
from bsmap_cli.slam.known_map import KnownMap, settings_for_map
from bsmap_cli.slam.slam import Slam
from bsmap_cli.slam.slam_settings import SlamSettings

Part = TypeVar("Part")


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What a run made.

    figures : counts for the report; stage_seconds : time by stage [s]; span_s : time from the
    first scan to the last [s]; losses : one line each for what was lost beyond reading.
    """

    document: MapDocument
    trajectory: Trajectory
    figures: dict[str, Any]
    stage_seconds: dict[str, float]
    span_s: float
    losses: tuple[str, ...]


def run_map(
    reader: LogReader,
    poses: Trajectory | Literal["odom"],
    settings: Settings,
    progress: Progress | None = None,
) -> Run:
    """Algorithm 1: a map from scans whose poses are known.

    poses : of the base in the map frame, looked up at each scan's stamp; or the log's odometry.

    Raises
    ------
    LogError : no scan could be used.
    """
    feed = Feed(reader, progress or Silent(), usable_cores())
    mapper = Mapper(_settings_for(MappingSettings, settings))
    pose_of = _pose_source(poses)
    stamps_ns, used_poses = array("q"), array("d")  # 32 bytes a scan
    insert_s = 0.0
    for scan in feed:
        pose_map_base = pose_of(scan)
        if pose_map_base is None:
            continue
        began = perf_counter()
        mapper.insert(scan, pose_map_base)
        insert_s += perf_counter() - began
        stamps_ns.append(scan.stamp_ns)
        used_poses.extend((pose_map_base.x, pose_map_base.y, pose_map_base.theta))
    used = len(stamps_ns)
    if not used:
        raise LogError(_no_pose(poses))
    trajectory = Trajectory(
        np.frombuffer(stamps_ns, np.int64), np.frombuffer(used_poses).reshape(-1, 3)
    )
    without = feed.count - used
    odometry = {"odometry": "none"} if isinstance(poses, Trajectory) else {}
    return _finished(
        feed,
        settings,
        mapper.document(),
        trajectory,
        figures={"scans_used": used, "keyframes": used, **odometry},
        stage_seconds={"merge": insert_s},
        losses=(f"{without} scans have no pose near their stamp",) if without else (),
    )


def run_slam(
    reader: LogReader,
    settings: Settings,
    progress: Progress | None = None,
    onlooker: Onlooker | None = None,
    *,
    old: MapDocument | None = None,
) -> Run:
    """Sec. IV and beyond: a map and a trajectory from scans alone.

    onlooker : shown every scan and the result; it changes neither.
    old : a map that the log goes on with; then map and trajectory are in its frame, and its knot
    step ends the ladder.

    Raises
    ------
    LogError : the log holds no usable scan.
    TrackingError : the log has no place in the old map, or more than one.
    MapFileError : the old map draws nothing.
    ConfigError : the settings keep the map as tracking built it, beside which no old one fits.
    UsageError : there is not memory enough for an old map so large.
    """
    progress = progress or Silent()
    # who looks on wants to see closed loops at once, and has threads, beside which none should fork
    cores = 1 if onlooker else usable_cores()
    feed = Feed(reader, progress, cores)
    known = None
    if old is not None:
        if not settings.final_map.rebuild:
            raise ConfigError(
                "final_map.rebuild: false does not go with an old map: the old and the new part "
                "become one when the map is built anew; leave it out, or set it to true"
            )
        refuse_too_large(old)
        settings = settings_for_map(settings, old)
        known = KnownMap(old, _settings_for(SlamSettings, settings))
    slam = Slam(_settings_for(SlamSettings, settings), known, cores=cores)
    scans = iter(feed)
    first = next(scans)  # what is wrong with the log is told before anything is compiled
    compile_for_slam()
    for scan in chain((first,), scans):
        slam.process(scan)
        if onlooker is not None:
            onlooker.scan(scan, slam)
    progress.stage("closing loops and building the final map")
    result = slam.finish()
    document, trajectory = result.document, result.trajectory
    if old is None:
        document, trajectory = _in_first_frame(document, trajectory)
    if onlooker is not None:
        onlooker.finished(document, trajectory)
    seconds = dict(slam.seconds)
    lost = len(result.figures["tracking_lost"])
    return _finished(
        feed,
        settings,
        document,
        trajectory,
        figures=result.figures,
        stage_seconds=seconds,
        losses=(f"tracking was lost and started again ({lost} times)",) if lost else (),
        old=old,
    )


def thinned_path(
    trajectory: Trajectory, *, step_m: float = 1.0, turn_rad: float = np.pi / 4
) -> NDArray[np.float32]:
    """(M, 3) float32: the first pose, and each one `step_m` or `turn_rad` from the last kept."""
    kept: list[Any] = []
    for pose in trajectory.poses:
        if kept:
            x, y, turn = pose - kept[-1]
            if np.hypot(x, y) < step_m and abs(wrap_angle(float(turn))) < turn_rad:
                continue
        kept.append(pose)
    return np.array(kept, np.float32).reshape(-1, 3)


def _finished(
    feed: Feed,
    settings: Settings,
    document: MapDocument,
    trajectory: Trajectory,
    *,
    figures: dict[str, Any],
    stage_seconds: dict[str, float],
    losses: tuple[str, ...],
    old: MapDocument | None = None,
) -> Run:
    read = feed.reader.report
    steps_m = np.diff(trajectory.poses[:, :2], axis=0)
    figures = {
        "scans": feed.count,
        "scans_used": feed.count,
        "scans_skipped": read.scans_skipped,
        "odometry": read.odometry,
        "travelled_m": float(np.hypot(steps_m[:, 0], steps_m[:, 1]).sum()),
        **figures,
        "settings": settings_as_dict(settings),
    }
    meta = {
        "software": f"bsmap {__version__}",
        "frame": "map",
        "sensor": feed.sensor,
        **{key: figures[key] for key in ("scans", "scans_used", "travelled_m", "settings")},
    }
    path = thinned_path(trajectory)
    if old is not None:
        path = np.concatenate((old.path, path))
        meta["logs"] = old.meta.get("logs", [])
    return Run(
        document=replace(document, meta=meta, path=path),
        trajectory=trajectory,
        figures=figures,
        stage_seconds={"read": feed.read_s, **stage_seconds},
        span_s=feed.span_s,
        losses=losses,
    )


def _in_first_frame(
    document: MapDocument, trajectory: Trajectory
) -> tuple[MapDocument, Trajectory]:
    """The same map and trajectory in the frame of the first pose, which refinement has moved."""
    pose_first_map = SE2.from_array(trajectory.poses[0]).inverse()
    levels = tuple(level.moved(pose_first_map) for level in document.levels)
    return replace(document, levels=levels), Trajectory(
        trajectory.stamps_ns, transform_poses(pose_first_map, trajectory.poses)
    )


def _settings_for(kind: type[Part], settings: Settings) -> Part:
    """The part of the settings that one algorithm declares, field by field."""
    names = (entry.name for entry in fields(kind))  # type: ignore[arg-type]
    return kind(**{name: getattr(settings, name) for name in names})


def _pose_source(poses: Trajectory | Literal["odom"]) -> Callable[[Scan], SE2 | None]:
    if isinstance(poses, Trajectory):
        track = PoseTrack(poses)
        return lambda scan: track.at(scan.stamp_ns)
    return lambda scan: scan.pose_odom_base


def _no_pose(poses: Trajectory | Literal["odom"]) -> str:
    if isinstance(poses, Trajectory):
        return "no pose lies near the stamp of any scan: are the poses of this log, and in seconds?"
    return "the log has no odometry: give the poses in a file, or use `bsmap slam`"
