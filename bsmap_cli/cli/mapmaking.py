"""What `slam` and `map` have in common: a log in, a map and a trajectory out, a report."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

from bsmap_cli.cli.compiled_code import start_compiler
from bsmap_cli.cli.formats import refuse_no_map, refuse_no_trajectory
from bsmap_cli.cli.inputs import STDIN
from bsmap_cli.cli.losses import exit_code, reading_losses, tell_warnings
from bsmap_cli.cli.options import (
    Force,
    Json,
    ReadFlags,
    SensorFlags,
    SettingsFlags,
    Strict,
    TrajectoryOut,
    option,
)
from bsmap_cli.cli.outputs import STDOUT, Outputs, write_trajectory
from bsmap_cli.cli.report import print_json, size
from bsmap_cli.cli.talk import Talk
from bsmap_cli.errors import UsageError
from bsmap_cli.logs.finding import counted

if TYPE_CHECKING:
    from bsmap_cli.config import Settings
    from bsmap_cli.logs.reader import LogReader
    from bsmap_cli.mapping.map_document import MapDocument
    from bsmap_cli.pipeline import Progress, Run

Work = Callable[["LogReader", "Settings", "Progress"], "Run"]


@dataclass(frozen=True, slots=True, kw_only=True)
class MakingFlags:
    """Where the results go and in which form."""

    output: Annotated[
        str, option("--output", "-o", metavar="MAP", help="The map file; `-`: stdout.")
    ]
    traj: TrajectoryOut = None
    levels: Annotated[
        str,
        option(
            "--levels",
            metavar="finest|all|STEP,...",
            help="Which knot steps of the ladder are written.",
        ),
    ] = "finest"
    compress: Annotated[
        bool, option("--compress", help="Write 3 bytes a control point, not 9 (rounds to 1 mm).")
    ] = False
    no_path: Annotated[
        bool,
        option("--no-path", help="Leave the thinned path out of the map (no free space then)."),
    ] = False
    force: Force = False
    strict: Strict = False
    json: Json = False


@dataclass(frozen=True, slots=True, kw_only=True)
class LogFlags:
    """All that says what is read and how it is used."""

    logs: tuple[str, ...]
    beside: tuple[str, ...] = ()  # other inputs, which no output may replace
    read: ReadFlags
    settings: SettingsFlags
    sensor: SensorFlags


def make_map(
    work: Work,
    log: LogFlags,
    making: MakingFlags,
    talk: Talk,
    *,
    old: MapDocument | None = None,
    poses: str | None = None,
) -> int:
    """Run `work` over the log, write what it made and report; the exit code.

    old : a map that is gone on with, whose knot step ends the ladder.
    poses : the file that tells where the robot was, so that no odometry is used.
    """
    start_compiler()
    from bsmap_cli.cli.progress import progress_bar
    from bsmap_cli.evaluation.map_statistics import map_statistics
    from bsmap_cli.logs.open_log import open_log
    from bsmap_cli.mapping.map_file import write_map
    from bsmap_cli.pipeline import full_report
    from bsmap_cli.slam.known_map import settings_for_map

    began = perf_counter()
    if making.json and STDOUT in (making.output, making.traj):
        raise UsageError("--json and an output on standard output do not go together: name a file")
    with Outputs(force=making.force, inputs=(*log.logs, *log.beside)) as outputs:
        map_out = outputs.add(making.output, binary=True)
        traj_out = outputs.add(making.traj) if making.traj is not None else None
        refuse_no_map(making.output)
        refuse_no_trajectory(making.traj)
        settings = log.settings.settings(log.sensor.overrides())
        if old is not None:
            settings = settings_for_map(settings, old)
        check_levels(making.levels, settings.ladder)
        if making.levels != "finest":
            every = replace(settings.final_map, all_levels=True)
            settings = replace(settings, final_map=every)
        options = log.read.options()
        with open_log(log.logs, options) as reader:

            def started() -> None:
                odometry = f"odometry: {reader.report.odometry}"
                talk.note(odometry if poses is None else f"poses: {poses}")

            with progress_bar(talk, started=started, total=options.max_scans) as bar:
                run = work(reader, settings, bar)
        tell_warnings(reader.report, talk)
        losses = (*reading_losses(reader.report), *run.losses)
        code = exit_code(losses, strict=making.strict, talk=talk)
        if not any(len(level) for level in run.document.levels):
            talk.warn("the map is empty: no scan has returns side by side; see `bsmap check`")
        write_began = perf_counter()
        document = _final_document(run.document, making, log.logs)
        encoded = BytesIO()
        sizes = write_map(encoded, document, compress=making.compress)
        map_out.open().write(encoded.getbuffer())
        if traj_out is not None:
            write_trajectory(traj_out, run.trajectory)
    ended = perf_counter()
    report = full_report(
        run,
        seconds=ended - began,
        write_s=ended - write_began,
        map_report=map_statistics(document, sizes).as_json() if making.json else None,
    )
    if making.json:
        print_json(report)
    talk.detail(stage_line(report))
    talk.note(summary_line(report, sizes.file_bytes))
    return code


def _final_document(
    document: MapDocument, making: MakingFlags, logs: tuple[str, ...]
) -> MapDocument:
    """What is written: the wanted levels, the path unless --no-path, and which logs it is of."""
    chosen = with_levels(document, making.levels)
    path = chosen.path[:0] if making.no_path else chosen.path
    before = chosen.meta.get("logs", [])  # of an old map that was gone on with
    described = [*before, *_describe(logs)] if isinstance(before, list) else _describe(logs)
    return replace(chosen, path=path, meta={**chosen.meta, "logs": described})


def check_levels(wanted: str, ladder: tuple[float, ...]) -> None:
    """Refuse --levels that the ladder does not have, before the work.

    Raises
    ------
    UsageError : a knot step that is not one of the ladder's, or no number.
    """
    if wanted in ("finest", "all"):
        return
    try:
        steps = {float(part) for part in wanted.split(",")}
    except ValueError:
        steps = {0.0}
    if not steps <= set(ladder):
        known = ", ".join(f"{step:g}" for step in ladder)
        raise UsageError(f"--levels {wanted}: give finest, all, or steps of the ladder ({known})")


def with_levels(document: MapDocument, wanted: str) -> MapDocument:
    """The document with the levels that `--levels` asks for, coarse to fine."""
    if wanted == "all" or document.parts:
        return document
    if wanted == "finest":
        return replace(document, levels=document.chosen_levels())
    steps = sorted({float(part) for part in wanted.split(",")}, reverse=True)
    chosen = (level for step in steps for level in document.chosen_levels(step))
    return replace(document, levels=tuple(chosen))


def summary_line(report: dict[str, Any], map_bytes: int) -> str:
    """The last line of a run."""
    pace = report["realtime_factor"]
    parts = [
        counted(report["scans"], "scan"),
        f"{report['seconds']:.1f} s",
        f"{pace:.{0 if pace >= 10 else 1}f} x real time" if pace is not None else "no duration",
        f"{report['scans_skipped']} skipped",
        f"{report['loops']} loops closed",
        f"map {size(map_bytes)}",
    ]
    return ", ".join(parts)


def stage_line(report: dict[str, Any]) -> str:
    """Where the time went."""
    stages = report["stage_seconds"].items()
    return "seconds: " + ", ".join(f"{name} {seconds:.2f}" for name, seconds in stages)


def _describe(logs: tuple[str, ...]) -> list[dict[str, Any]]:
    """Name and size of each log, no path; what came through a pipe has no name."""
    return [
        {"name": "standard input"}
        if log == STDIN
        else {"name": _utf8(Path(log).resolve().name), "bytes": _bytes_of(Path(log))}
        for log in logs
    ]


def _utf8(name: str) -> str:
    """The name of a file, whose bytes need not be text."""
    return os.fsencode(name).decode("utf-8", "replace")


def _bytes_of(path: Path) -> int:
    parts = path.rglob("*") if path.is_dir() else [path]
    return sum(part.stat().st_size for part in parts if part.is_file())
