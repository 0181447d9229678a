"""The run of a log through the method: the loop, the timings and the report; it knows no disk."""

from __future__ import annotations

import sys
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from time import perf_counter
from typing import Any, Literal, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from bsmap_cli import __version__
from bsmap_cli.config import Settings, settings_as_dict
from bsmap_cli.errors import LogError
from bsmap_cli.geometry.se2 import SE2, wrap_angle
from bsmap_cli.logs.reader import LogReader
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.mapper import Mapper
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.sensor.pose_track import PoseTrack
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.trajectory import Trajectory
from bsmap_cli.slam.slam import Slam
from bsmap_cli.slam.slam_settings import SlamSettings

STAGES = ("read", "fit", "register", "merge", "loops", "graph", "final_map", "write")
Part = TypeVar("Part")


class Progress(Protocol):
    """Who is told how far a run has come."""

    def scans(self, count: int, span_s: float) -> None:
        """`count` scans are through, which span so many seconds of the log."""

    def stage(self, name: str) -> None:
        """The run turns to another task."""


class Silent:
    """A `Progress` that tells nobody."""

    def scans(self, count: int, span_s: float) -> None:
        """Say nothing."""

    def stage(self, name: str) -> None:
        """Say nothing."""


@dataclass(slots=True, kw_only=True)
class Run:
    """What a run made.

    report : the JSON report, without what only the end of the command knows (see `completed`).
    losses : one line each for what was lost beyond reading; empty when all went well.
    """

    document: MapDocument
    trajectory: Trajectory
    report: dict[str, Any]
    losses: tuple[str, ...] = ()


@dataclass(slots=True)
class _Feed:
    """Draws the scans of a reader, counts them and takes the time that reading needs."""

    reader: LogReader
    progress: Progress
    read_s: float = 0.0
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0

    def __iter__(self) -> Iterator[Scan]:
        source = iter(self.reader.scans())
        while True:
            began = perf_counter()
            scan = next(source, None)
            self.read_s += perf_counter() - began
            if scan is None:
                break
            if not self.count:
                self.first_ns = scan.stamp_ns
            self.count += 1
            self.last_ns = scan.stamp_ns
            yield scan
            self.progress.scans(self.count, self.span_s)
        if not self.count:
            raise LogError("the log holds no usable scan: see `bsmap info` for what it holds")

    @property
    def span_s(self) -> float:
        """Time from the first scan to the last [s]."""
        return (self.last_ns - self.first_ns) / 1e9


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
    feed = _Feed(reader, progress or Silent())
    mapper = Mapper(settings_for(MappingSettings, settings))
    pose_of = _pose_source(poses)
    stamps_ns, poses_used = array("q"), array("d")  # 32 bytes a scan
    insert_s = 0.0
    for scan in feed:
        pose_map_base = pose_of(scan)
        if pose_map_base is None:
            continue
        began = perf_counter()
        mapper.insert(scan, pose_map_base)
        insert_s += perf_counter() - began
        stamps_ns.append(scan.stamp_ns)
        poses_used.extend((pose_map_base.x, pose_map_base.y, pose_map_base.theta))
    used = len(stamps_ns)
    if not used:
        raise LogError(_no_pose(poses))
    trajectory = Trajectory(
        np.frombuffer(stamps_ns, np.int64), np.frombuffer(poses_used).reshape(-1, 3)
    )
    figures = {"scans_used": used, "keyframes": used, "stage_seconds": {"merge": insert_s}}
    without = feed.count - used
    lost = (f"{without} scans have no pose near their stamp",) if without else ()
    return _finished(feed, settings, mapper.document(), trajectory, figures=figures, losses=lost)


def run_slam(reader: LogReader, settings: Settings, progress: Progress | None = None) -> Run:
    """Sec. IV and beyond: a map and a trajectory from scans alone.

    Raises
    ------
    LogError : the log holds no usable scan.
    """
    progress = progress or Silent()
    feed = _Feed(reader, progress)
    slam = Slam(settings_for(SlamSettings, settings))
    for scan in feed:
        slam.process(scan)
    progress.stage("closing loops and building the final map")
    result = slam.finish()
    figures = {**result.figures, "stage_seconds": _stages(slam.seconds)}
    lost = figures.get("tracking_lost") or ()
    losses = (f"tracking was lost and started again {len(lost)} times",) if lost else ()
    return _finished(
        feed, settings, result.document, result.trajectory, figures=figures, losses=losses
    )


def completed(run: Run, *, seconds: float, write_s: float) -> dict[str, Any]:
    """The report with what is known once the files are written: `seconds` of the whole command."""
    report = dict(run.report)
    stages = {**report["stage_seconds"], "write": write_s}
    tracking_s = stages["fit"] + stages["register"] + stages["merge"]
    span_s = report.pop("_span_s")
    report |= {
        "stage_seconds": {name: round(stages[name], 4) for name in STAGES},
        "seconds": round(seconds, 4),
        "scans_per_second": _rate(report["scans"], seconds),
        "tracking_scans_per_second": _rate(report["scans"], tracking_s),
        "realtime_factor": _rate(span_s, seconds) if span_s > 0 else None,
        "peak_memory_mb": round(_peak_memory_mb(), 1),
    }
    return report


def settings_for(kind: type[Part], settings: Settings) -> Part:
    """The part of the settings that one algorithm declares, field by field."""
    names = (entry.name for entry in fields(kind))  # type: ignore[arg-type]
    return kind(**{name: getattr(settings, name) for name in names})


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
    feed: _Feed,
    settings: Settings,
    document: MapDocument,
    trajectory: Trajectory,
    *,
    figures: dict[str, Any],
    losses: tuple[str, ...],
) -> Run:
    read = feed.reader.report
    resolved = settings_as_dict(settings)
    travelled_m = round(_length_m(trajectory), 4)
    stages = dict.fromkeys(STAGES, 0.0) | figures.pop("stage_seconds", {})
    stages["read"] = feed.read_s
    report = {
        "scans": feed.count,
        "scans_used": feed.count,
        "scans_skipped": read.scans_skipped,
        "keyframes": 0,
        "submaps": 0,
        "loops": 0,
        "loops_tried": 0,
        "loops_rejected": 0,
        "tracking_lost": [],
        "degenerate_share": 0.0,
        "odometry": read.odometry,
        "travelled_m": travelled_m,
        **figures,
        "stage_seconds": stages,
        "settings": resolved,
        "_span_s": feed.span_s,
    }
    meta = {
        "software": f"bsmap {__version__}",
        "frame": "map",
        "scans": report["scans"],
        "scans_used": report["scans_used"],
        "settings": resolved,
        "travelled_m": travelled_m,
        **document.meta,
    }
    return Run(
        document=replace(document, meta=meta, path=thinned_path(trajectory)),
        trajectory=trajectory,
        report=report,
        losses=losses,
    )


def _pose_source(poses: Trajectory | Literal["odom"]) -> Callable[[Scan], SE2 | None]:
    if isinstance(poses, Trajectory):
        track = PoseTrack(poses)
        return lambda scan: track.at(scan.stamp_ns)
    return lambda scan: scan.pose_odom_base


def _stages(seconds: dict[str, float]) -> dict[str, float]:
    """Seconds by the names of the report: tracking is registration and what it inserts."""
    named = dict(seconds)
    return {"register": named.pop("track", 0.0), **named}


def _no_pose(poses: Trajectory | Literal["odom"]) -> str:
    if isinstance(poses, Trajectory):
        return "no pose lies near the stamp of any scan: are the poses of this log, and in seconds?"
    return "the log has no odometry: give the poses in a file, or use `bsmap slam`"


def _length_m(trajectory: Trajectory) -> float:
    steps = np.diff(trajectory.poses[:, :2], axis=0)
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum())


def _rate(amount: float, seconds: float) -> float | None:
    return round(amount / seconds, 2) if seconds > 0 else None


def _peak_memory_mb() -> float:
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6
