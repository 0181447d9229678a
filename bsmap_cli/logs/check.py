"""Will mapping work: what is wrong with a log, and what to do about each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from bsmap_cli.logs.check_scans import ScanStatistics
from bsmap_cli.logs.reader import LogReader, ReadReport

Level = Literal["problem", "warning", "note"]

GAP_S = 1.0
"""Longer than this without a scan is a gap, and longer than five usual intervals."""

CLOCKS_APART_S = 1.0
FEW_RETURNS_SHARE = 0.5
FOLLOWED_STEP_M, FOLLOWED_TURN_DEG = 0.4, 35.0
"""How far from the last pose tracking searches when it is lost; motion beyond needs odometry."""

OFTEN_SHARE = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing that is wrong with a log, or worth to know.

    name : "gaps", "stamps", ... for programs. level : "problem" where mapping will suffer,
    "warning" where it may, "note" otherwise. remedy : what to do about it.
    value : the measure behind it, in the unit that the message names.
    """

    name: str
    level: Level
    message: str
    remedy: str
    value: float


def check_log(reader: LogReader) -> list[Finding]:
    """Read the log through and judge it, the gravest findings first.

    Raises what `LogReader.scans` raises: a log that cannot be read has no findings.
    """
    statistics = ScanStatistics(FOLLOWED_STEP_M, FOLLOWED_TURN_DEG)
    for scan in reader.scans():
        statistics.add(scan)
    findings = [*_of_report(reader.report), *_of_scans(statistics, reader.report)]
    order: tuple[Level, ...] = ("problem", "warning", "note")
    return sorted(findings, key=lambda finding: order.index(finding.level))


def _of_report(report: ReadReport) -> Iterator[Finding]:
    if report.truncated:
        yield Finding(
            name="damage",
            level="problem",
            message="part of the log is missing or damaged",
            remedy="copy it again, or map what is there: it is used up to the damage",
            value=1.0,
        )
    if report.scans_skipped:
        share = report.scans_skipped / (report.scans_skipped + report.scans_read)
        yield Finding(
            name="skipped",
            level="problem" if share > OFTEN_SHARE else "warning",
            message=f"{report.scans_skipped} scans cannot be read ({share:.1%})",
            remedy="see the warnings for the first of them; mapping goes on without them",
            value=float(report.scans_skipped),
        )
    if report.places_unknown:
        yield Finding(
            name="mounting",
            level="warning",
            message="the log does not tell where the laser sits on the base",
            remedy="give --laser-pose x,y,yaw_deg, or record /tf_static",
            value=1.0,
        )
    if report.recorded_after_s is not None:
        worst_s = max(report.recorded_after_s, key=abs)
        if abs(worst_s) > CLOCKS_APART_S:
            yield Finding(
                name="clocks",
                level="warning",
                message=f"stamps of scans and times of recording are up to {abs(worst_s):.1f} s"
                " apart",
                remedy="set the clocks of sensor and computer; if odometry has another clock than"
                " the scans, give --odom none",
                value=worst_s,
            )


def _of_scans(statistics: ScanStatistics, report: ReadReport) -> Iterator[Finding]:
    yield from _of_stamps(statistics, report)
    yield from _of_beams(statistics)
    yield from _of_motion(statistics, report)


def _of_stamps(statistics: ScanStatistics, report: ReadReport) -> Iterator[Finding]:
    usual_s = statistics.usual_interval_s()
    limit_s = max(GAP_S, 5.0 * usual_s)
    gaps = [(at_s, gap_s) for at_s, gap_s in statistics.longest_intervals() if gap_s > limit_s]
    if gaps:
        at_s, longest_s = max(gaps, key=lambda gap: gap[1])
        has_odometry = report.odometry != "none"
        yield Finding(
            name="gaps",
            level="warning" if has_odometry else "problem",
            message=f"{len(gaps)} gaps between scans, the longest {longest_s:.1f} s at"
            f" {at_s:.1f} s (usual: {usual_s:.3f} s)",
            remedy="odometry bridges them"
            if has_odometry
            else "map the parts on their own with --start and --end, or record odometry",
            value=longest_s,
        )
    if statistics.steps_back:
        yield Finding(
            name="stamps",
            level="warning",
            message=f"{statistics.steps_back} stamps step back, by up to"
            f" {statistics.farthest_back_s:.3f} s",
            remedy="the order of the log is kept and speeds are not taken from such stamps; stamp"
            " scans where they are measured",
            value=statistics.farthest_back_s,
        )
    if statistics.repeated:
        yield Finding(
            name="repeated stamps",
            level="warning",
            message=f"{statistics.repeated} stamps repeat the one before",
            remedy="look for a scan that was published twice",
            value=float(statistics.repeated),
        )


def _of_beams(statistics: ScanStatistics) -> Iterator[Finding]:
    counts = sorted(statistics.beam_counts)
    if len(counts) > 1:
        yield Finding(
            name="beams",
            level="note",
            message=f"the number of beams changes: {counts[0]} to {counts[-1]}",
            remedy="none is needed: each scan has its own angles",
            value=float(len(counts)),
        )
    invalid = statistics.invalid_share()
    if invalid > FEW_RETURNS_SHARE:
        yield Finding(
            name="returns",
            level="warning",
            message=f"{invalid:.0%} of the beams have no return",
            remedy="if the sensor sees farther or nearer than the log states, give --range MIN,MAX",
            value=invalid,
        )
    blind = statistics.blind / statistics.count
    if blind > 0.0:
        yield Finding(
            name="blind scans",
            level="problem" if blind > OFTEN_SHARE else "warning",
            message=f"{statistics.blind} scans have hardly a return ({blind:.1%})",
            remedy="odometry bridges a few; look for a covered lens or a robot lifted up",
            value=float(statistics.blind),
        )


def _of_motion(statistics: ScanStatistics, report: ReadReport) -> Iterator[Finding]:
    if report.odometry == "none":
        yield Finding(
            name="odometry",
            level="note",
            message="there is no odometry, or none is used",
            remedy="none is needed where scans overlap well; in bare corridors record it",
            value=0.0,
        )
    far = statistics.far_steps
    if not far:
        return
    often = far / statistics.count > OFTEN_SHARE
    how = "by the odometry" if report.odometry != "none" else "by the scans"
    yield Finding(
        name="steps",
        level="problem" if often and report.odometry == "none" else "warning",
        message=f"{far} steps from scan to scan are longer than {FOLLOWED_STEP_M} m or"
        f" {FOLLOWED_TURN_DEG:.0f} degrees, {how}; the longest {statistics.longest_step_m:.2f} m,"
        f" {statistics.widest_turn_deg:.0f} degrees",
        remedy="tracking follows them only by odometry: drive more slowly or record more scans a"
        " second; read without --every",
        value=float(far),
    )
