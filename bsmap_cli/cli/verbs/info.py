"""`bsmap info`: what a log holds."""

from __future__ import annotations

from bsmap_cli.cli.inputs import log_sources
from bsmap_cli.cli.losses import exit_code, reading_losses, tell_warnings
from bsmap_cli.cli.options import Json, Logs, ReadFlags, TalkFlags
from bsmap_cli.cli.report import print_json, print_rows, print_table


def run(*, talk: TalkFlags, read: ReadFlags, logs: Logs = None, json: Json = False) -> int:
    """Show topics, rates and frames of a log, and what `slam` takes.

    \b
    Example:
      bsmap info run.mcap
    """
    from dataclasses import asdict

    from bsmap_cli.logs.open_log import open_log

    with open_log(log_sources(logs), read.options()) as reader:
        info = reader.info()
    voice = talk.talk()
    tell_warnings(reader.report, voice)
    code = exit_code(reading_losses(reader.report), strict=False, talk=voice)
    if json:
        print_json(asdict(info))
        return code
    print_rows(
        [
            ("format", info.format),
            ("duration", f"{info.duration_s:.2f} s"),
            ("beams", str(info.beams)),
            ("odometry", info.odometry),
            ("taken by slam", ", ".join(info.selected) or "nothing: choose one with --topic"),
        ],
        voice,
    )
    header = ("topic", "type", "messages", "rate", "frame", "scans")
    rows = [
        (
            topic.topic,
            topic.type,
            str(topic.messages),
            f"{topic.rate_hz:.1f} Hz",
            topic.frame,
            "yes" if topic.usable else "",
        )
        for topic in info.topics
    ]
    print_table(header, rows, voice)
    return code
