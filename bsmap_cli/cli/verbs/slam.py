"""`bsmap slam`: a map and a trajectory from scans alone."""

from __future__ import annotations

from bsmap_cli.cli.inputs import log_sources
from bsmap_cli.cli.live import LiveFlags
from bsmap_cli.cli.mapmaking import LogFlags, MakingFlags, make_map
from bsmap_cli.cli.options import Logs, ReadFlags, SensorFlags, SettingsFlags, TalkFlags


def run(
    *,
    talk: TalkFlags,
    making: MakingFlags,
    read: ReadFlags,
    settings: SettingsFlags,
    sensor: SensorFlags,
    live: LiveFlags,
    logs: Logs = None,
) -> int:
    """Make a map and a trajectory from a log.

    Each scan is matched against the curves of the map, coarse to fine, starting from odometry
    where the log has any; then it extends and refines the map. Where the robot comes back, the
    loop is closed, and in the end the whole map is built once more from the corrected poses.

    The map frame is the robot's pose at the first used scan. The trajectory is the pose of the
    robot's base in that frame, one line for every scan. A second run with the same log and
    settings gives the same bytes.

    \b
    Example:
      bsmap slam run.mcap -o map.bsm --traj map.tum
      bsmap slam bag_folder/ --odom none --set ladder=[0.2,0.1] --json -o map.bsm
      cat run.mcap | bsmap slam - -o - | bsmap stats -
      bsmap slam run.mcap -o map.bsm --live
    """
    from bsmap_cli.pipeline import run_slam

    log = LogFlags(logs=log_sources(logs), read=read, settings=settings, sensor=sensor)
    voice = talk.talk()
    return make_map(live.watched(run_slam, voice), log, making, voice)
