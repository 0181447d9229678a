"""`bsmap map`: a map from scans whose poses are known (Algorithm 1)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Literal

from bsmap_cli.cli.inputs import STDIN, log_sources, read_trajectory
from bsmap_cli.cli.mapmaking import LogFlags, MakingFlags, make_map
from bsmap_cli.cli.options import Logs, ReadFlags, SensorFlags, SettingsFlags, TalkFlags, option
from bsmap_cli.errors import UsageError

if TYPE_CHECKING:
    from bsmap_cli.config import Settings
    from bsmap_cli.logs.reader import LogReader
    from bsmap_cli.pipeline import Progress, Run
    from bsmap_cli.sensor.trajectory import Trajectory


def run(
    *,
    talk: TalkFlags,
    making: MakingFlags,
    poses: Annotated[
        str,
        option(
            "--poses",
            metavar="FILE|odom",
            help="Where the robot was: a trajectory (TUM) in the map frame, or the log's odometry.",
        ),
    ],
    read: ReadFlags,
    settings: SettingsFlags,
    sensor: SensorFlags,
    logs: Logs = None,
) -> int:
    """Make a map from a log when the poses are known.

    Each scan is cut into clusters, each cluster becomes a B-spline curve, and each curve extends
    and refines the map where it meets it: Algorithm 1 of the paper. The pose of a scan is looked
    up at its stamp; a scan without a pose near it is left out and counted.

    \b
    Example:
      bsmap map run.mcap --poses truth.tum -o map.bsm
      bsmap map run.mcap --poses odom -o rough.bsm
    """
    from bsmap_cli.pipeline import run_map

    def work(reader: LogReader, chosen: Settings, progress: Progress) -> Run:
        known: Trajectory | Literal["odom"] = "odom"
        if poses != known:
            known = read_trajectory(poses)
        return run_map(reader, known, chosen, progress)

    sources = log_sources(logs)
    beside = () if poses == "odom" else (poses,)
    if STDIN in sources and STDIN in beside:
        raise UsageError("log and poses cannot both come from standard input: name one of them")
    log = LogFlags(logs=sources, beside=beside, read=read, settings=settings, sensor=sensor)
    file = None if poses == "odom" else poses
    return make_map(work, log, making, talk.talk(), poses=file)
