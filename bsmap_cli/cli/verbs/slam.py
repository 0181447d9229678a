"""`bsmap slam`: a map and a trajectory from scans alone."""

from __future__ import annotations

from functools import partial
from typing import Annotated

from bsmap_cli.cli.inputs import STDIN, log_sources, read_map_file
from bsmap_cli.cli.live import LiveFlags
from bsmap_cli.cli.mapmaking import LogFlags, MakingFlags, make_map
from bsmap_cli.cli.options import Logs, ReadFlags, SensorFlags, SettingsFlags, TalkFlags, option
from bsmap_cli.errors import UsageError


def run(
    *,
    talk: TalkFlags,
    making: MakingFlags,
    map_: Annotated[
        str | None,
        option("--map", metavar="MAP", help="Go on with this map; `-`: standard input."),
    ] = None,
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

    With --map the log goes on with a map made before. Where it starts is not known: what it sees
    is searched for in the whole old map. The new map holds both, in the frame of the old one, as
    does the trajectory; walls seen again are refined and not drawn twice, new parts are added,
    and what the robot now looks through is removed. The old map's knot step ends the ladder. A
    log that has no place in the old map, or more than one, ends with exit code 1.

    \b
    Example:
      bsmap slam run.mcap -o map.bsm --traj map.tum
      bsmap slam bag_folder/ --odom none --set ladder=[0.2,0.1] --json -o map.bsm
      bsmap slam run.mcap --map map.bsm -o both.bsm --traj later.tum
      cat run.mcap | bsmap slam - -o - | bsmap stats -
      bsmap slam run.mcap -o map.bsm --live
    """
    from bsmap_cli.pipeline import run_slam

    sources = log_sources(logs)
    if STDIN in sources and map_ == STDIN:
        raise UsageError("log and map cannot both come from standard input: name one of them")
    beside = () if map_ is None else (map_,)
    log = LogFlags(logs=sources, beside=beside, read=read, settings=settings, sensor=sensor)
    old = None if map_ is None else read_map_file(map_)[0]
    voice = talk.talk()
    work = live.watched(partial(run_slam, old=old), voice)
    return make_map(work, log, making, voice, old=old)
