"""`bsmap scans`: the scans of a log as a stream another program can read."""

from __future__ import annotations

from typing import Annotated

from bsmap_cli.cli.formats import LOG_FORMATS, chosen_format
from bsmap_cli.cli.inputs import log_sources
from bsmap_cli.cli.losses import exit_code, reading_losses, tell_warnings
from bsmap_cli.cli.options import Force, Logs, ReadFlags, Strict, TalkFlags, option
from bsmap_cli.cli.outputs import Outputs
from bsmap_cli.logs.finding import counted


def run(
    *,
    talk: TalkFlags,
    read: ReadFlags,
    output: Annotated[
        str,
        option("--output", "-o", metavar="FILE", help="The log: .mcap, .bag or .csv; `-`: stdout."),
    ],
    logs: Logs = None,
    format_: Annotated[
        str | None,
        option(
            "--format", metavar="mcap|bag|csv", help="The format, where the name does not tell."
        ),
    ] = None,
    force: Force = False,
    strict: Strict = False,
) -> int:
    """Write the scans of a log, with odometry, in another format.

    Ranges are written as they were read; scans that cannot be read are left out and counted.

    \b
    Example:
      bsmap scans run.bag -o run.mcap
      bsmap scans run.mcap -o - --format csv | head -1
    """
    from bsmap_cli.exchange.log_writers import write_log
    from bsmap_cli.logs.open_log import open_log

    sources = log_sources(logs)
    voice = talk.talk()
    kind = chosen_format(output, format_, LOG_FORMATS)
    with Outputs(force=force, inputs=sources) as outputs:
        target = outputs.add(output, binary=kind != "csv", stream=True)
        with open_log(sources, read.options()) as reader:
            count = write_log(target.open(), reader.scans(), kind)
            tell_warnings(reader.report, voice)
            losses = reading_losses(reader.report)
        code = exit_code(losses, strict=strict, talk=voice)
    voice.note(f"{counted(count, 'scan')} written")
    return code
