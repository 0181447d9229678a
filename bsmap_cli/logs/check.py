"""Will mapping work: what is wrong with a log, and what to do about each."""

from __future__ import annotations

from collections.abc import Iterator

from bsmap_cli.logs.check_reading import reading_findings
from bsmap_cli.logs.check_scans import ScanStatistics
from bsmap_cli.logs.finding import LEVELS, OFTEN_SHARE, Finding, counted, worse_if
from bsmap_cli.logs.reader import LogReader, ReadReport

GAP_S = 1.0
"""Longer than this without a scan is a gap, and longer than five usual intervals."""

CLOCK_SET_S = 3600.0
"""No robot pauses that long in one run: the clock was set."""

FEW_RETURNS_SHARE = 0.5
FAR_M = 100.0
"""No planar lidar meets most of its surroundings farther away: the ranges are not in metres."""

FOLLOWED_STEP_M, FOLLOWED_TURN_DEG = 0.4, 35.0
"""How far from the last pose tracking searches when it is lost; motion beyond needs odometry."""


def check_log(reader: LogReader) -> list[Finding]:
    """Read the log through and judge it, the gravest findings first.

    Raises what `LogReader.scans` raises: a log that cannot be read has no findings.
    """
    statistics = ScanStatistics(FOLLOWED_STEP_M, FOLLOWED_TURN_DEG)
    for scan in reader.scans():
        statistics.add(scan)
    findings = [*reading_findings(reader.report), *_of_scans(statistics, reader.report)]
    return sorted(findings, key=lambda finding: LEVELS.index(finding.level))


def _of_scans(statistics: ScanStatistics, report: ReadReport) -> Iterator[Finding]:
    yield from _of_stamps(statistics, report)
    yield from _of_beams(statistics)
    yield from _of_motion(statistics, report)


def _of_stamps(statistics: ScanStatistics, report: ReadReport) -> Iterator[Finding]:
    usual_s = statistics.usual_interval_s()
    limit_s = max(GAP_S, 5.0 * usual_s)
    intervals = statistics.longest_intervals()
    jumps = [(at_s, gap_s) for at_s, gap_s in intervals if gap_s > CLOCK_SET_S]
    gaps = [(at_s, gap_s) for at_s, gap_s in intervals if limit_s < gap_s <= CLOCK_SET_S]
    if statistics.farthest_back_s > CLOCK_SET_S or jumps:
        at_s, ahead_s = max(jumps, key=lambda gap: gap[1], default=(0.0, 0.0))
        back_s = statistics.farthest_back_s
        how = f"back by {back_s:.0f} s" if back_s > ahead_s else f"ahead by {ahead_s:.0f} s"
        yield Finding(
            name="clock set",
            level="warning",
            message=f"the clock of the scans was set during the run: stamps jump {how}",
            remedy="the map does not suffer, stamps of the trajectory jump too; odometry must have"
            " the same clock, else give --odom none",
            value=max(back_s, ahead_s),
        )
    if gaps:
        at_s, longest_s = max(gaps, key=lambda gap: gap[1])
        has_odometry = report.odometry != "none"
        yield Finding(
            name="gaps",
            level=worse_if(not has_odometry),
            message=f"{counted(len(gaps), 'gap')} between scans, the longest {longest_s:.1f} s at"
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
            message=f"{counted(statistics.steps_back, 'stamp')} earlier than the one before, by up"
            f" to {statistics.farthest_back_s:.3f} s",
            remedy="mapping keeps to the order of the log and takes no speeds from such stamps; to"
            " mend the log, take stamps where the lidar is read",
            value=statistics.farthest_back_s,
        )
    if statistics.repeated:
        yield Finding(
            name="repeated stamps",
            level="warning",
            message=f"{counted(statistics.repeated, 'stamp')} equal to the one before",
            remedy="mapping keeps to the order of the log; look whether scans are published twice"
            " or the clock is coarse",
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
    usual_m = statistics.usual_range_m()
    if usual_m > FAR_M:
        yield Finding(
            name="units",
            level="problem",
            message=f"ranges are about {usual_m:.0f}, which are no metres in front of a lidar",
            remedy="write them in metres: many sensors give millimetres",
            value=usual_m,
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
            level=worse_if(blind > OFTEN_SHARE),
            message=f"{counted(statistics.blind, 'scan')} with hardly a return ({blind:.1%})",
            remedy="odometry bridges a few; look for a covered lens or a robot lifted up",
            value=float(statistics.blind),
        )
    sectors = statistics.steady.sectors()
    if sectors:
        places = " and ".join(
            f"{sector.from_deg} to {sector.to_deg} degrees ({sector.range_m:.2f} m)"
            for sector in sectors
        )
        flags = " ".join(f"--ignore-angles {part.from_deg},{part.to_deg}" for part in sectors)
        yield Finding(
            name="robot in view",
            level="warning",
            message=f"beams always meet something near by: {places}",
            remedy=f"if that is the robot itself, give {flags}",
            value=float(len(sectors)),
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
        level=worse_if(often and report.odometry == "none"),
        message=f"{counted(far, 'step')} from scan to scan longer than {FOLLOWED_STEP_M} m or"
        f" {FOLLOWED_TURN_DEG:.0f} degrees, {how}; the longest {statistics.longest_step_m:.2f} m,"
        f" {statistics.widest_turn_deg:.0f} degrees",
        remedy="tracking follows them by the odometry alone: drive more slowly or record more scans"
        " a second"
        if report.odometry != "none"
        else "tracking may lose them: record odometry, drive more slowly or record more scans a"
        " second",
        value=float(far),
    )
