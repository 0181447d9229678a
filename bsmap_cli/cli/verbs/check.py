"""`bsmap check`: will mapping work with this log."""

from __future__ import annotations

from bsmap_cli.cli.inputs import log_sources
from bsmap_cli.cli.losses import exit_code, reading_losses, tell_warnings
from bsmap_cli.cli.options import Json, Logs, ReadFlags, Strict, TalkFlags
from bsmap_cli.cli.report import print_json, print_text
from bsmap_cli.cli.talk import RED, YELLOW, harmless
from bsmap_cli.logs.finding import counted


def run(
    *,
    talk: TalkFlags,
    read: ReadFlags,
    logs: Logs = None,
    strict: Strict = False,
    json: Json = False,
) -> int:
    """Read a log through and tell what is wrong, each with its remedy.

    Looked for: gaps, stamps that are zero, repeat or step back, clocks that are apart or were set,
    changing beam counts, beams without return or on the robot itself, a laser that is tilted, moves
    or whose place is unknown, and steps from scan to scan that are longer than tracking can follow.

    \b
    Example:
      bsmap check run.mcap
    """
    import sys
    from dataclasses import asdict

    from bsmap_cli.logs.check import check_log
    from bsmap_cli.logs.open_log import open_log

    voice = talk.talk()
    with open_log(log_sources(logs), read.options()) as reader:
        findings = check_log(reader)
    scans = reader.report.scans_read
    if json:
        listed = [asdict(finding) for finding in findings]
        print_json({"scans": scans, "findings": listed, "warnings": reader.report.warnings})
    else:
        tell_warnings(reader.report, voice, found=False)
        found = counted(len(findings), "finding") if findings else "no findings"
        print_text(f"{counted(scans, 'scan')} read, {found}\n")
        for finding in findings:
            color = {"problem": RED, "warning": YELLOW}.get(finding.level, "0")
            level = voice.paint(f"{finding.level}:", color, sys.stdout)
            print_text(f"{level} {harmless(finding.message)}\n    {harmless(finding.remedy)}\n")
    return exit_code(reading_losses(reader.report), strict=strict, talk=voice)
