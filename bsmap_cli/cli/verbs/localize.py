"""`bsmap localize`: where was the robot in a saved map?"""

from __future__ import annotations

from time import perf_counter
from typing import Annotated, Any

from bsmap_cli.cli.compiled_code import start_compiler
from bsmap_cli.cli.formats import refuse_no_trajectory
from bsmap_cli.cli.inputs import STDIN, log_sources, read_map_file
from bsmap_cli.cli.losses import exit_code, reading_losses, tell_warnings
from bsmap_cli.cli.options import (
    Force,
    Json,
    Logs,
    ReadFlags,
    SensorFlags,
    SettingsFlags,
    Strict,
    TalkFlags,
    TrajectoryOut,
    option,
)
from bsmap_cli.cli.outputs import STDOUT, Outputs, write_trajectory
from bsmap_cli.cli.report import print_json
from bsmap_cli.errors import UsageError
from bsmap_cli.logs.finding import counted


def run(
    *,
    talk: TalkFlags,
    map_: Annotated[
        str, option("--map", metavar="MAP", help="The map the robot is in; `-`: standard input.")
    ],
    traj: TrajectoryOut = None,
    read: ReadFlags,
    settings: SettingsFlags,
    sensor: SensorFlags,
    logs: Logs = None,
    force: Force = False,
    strict: Strict = False,
    json: Json = False,
) -> int:
    """Tell where the robot was in a saved map, its start unknown.

    What the robot sees is searched for in the whole map, all positions and headings, until one
    place alone fits; then each scan is followed from the last. Where the map no longer fits, the
    search begins anew. The trajectory is in the frame of the map and has a pose for every scan,
    also for those before the place was found. The map stays as it is; its knot step ends the
    ladder.

    \b
    Example:
      bsmap localize run.mcap --map map.bsm --traj where.tum
      bsmap localize run.mcap --map map.bsm --json
    """
    start_compiler()
    from bsmap_cli.cli.progress import progress_bar
    from bsmap_cli.logs.open_log import open_log
    from bsmap_cli.pipeline import run_localize

    voice, began = talk.talk(), perf_counter()
    sources = log_sources(logs)
    if STDIN in sources and map_ == STDIN:
        raise UsageError("log and map cannot both come from standard input: name one of them")
    if json and traj == STDOUT:
        raise UsageError("--json and an output on standard output do not go together: name a file")
    with Outputs(force=force, inputs=(*sources, map_)) as outputs:
        target = outputs.add(traj) if traj is not None else None
        refuse_no_trajectory(traj)
        chosen = settings.settings(sensor.overrides())
        document, _ = read_map_file(map_)
        options = read.options()
        with open_log(sources, options) as reader:

            def started() -> None:
                voice.note(f"odometry: {reader.report.odometry}")

            with progress_bar(voice, started=started, total=options.max_scans) as bar:
                located = run_localize(reader, document, chosen, bar)
        tell_warnings(reader.report, voice)
        losses = (*reading_losses(reader.report), *located.losses)
        code = exit_code(losses, strict=strict, talk=voice)
        if target is not None:
            write_trajectory(target, located.trajectory)
    report = {**located.figures, "seconds": round(perf_counter() - began, 4)}
    if json:
        print_json(report)
    voice.note(_summary(report))
    return code


def _summary(report: dict[str, Any]) -> str:
    return (
        f"{counted(report['scans'], 'scan')}, found after {report['converged_after_scans']}, "
        f"{report['lost']} lost, {report['seconds']:.1f} s"
    )
