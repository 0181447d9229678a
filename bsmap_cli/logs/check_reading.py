"""What reading a log already tells: damage, bad scans, lasers and clocks."""

from __future__ import annotations

from collections.abc import Iterator

from bsmap_cli.logs.finding import OFTEN_SHARE, Finding, counted, worse_if
from bsmap_cli.logs.reader import TELL_PLACE, ReadReport

CLOCKS_APART_S = 1.0


def reading_findings(report: ReadReport) -> Iterator[Finding]:
    """Findings from the report of a log that was read through."""
    yield from _of_bytes(report)
    yield from _of_lasers(report)
    yield from _of_clocks(report)


def _of_bytes(report: ReadReport) -> Iterator[Finding]:
    if report.truncated:
        yield Finding(
            name="damage",
            level="problem",
            message="part of the log is missing or damaged",
            remedy="copy it again, or map what is there: all that can be read is used",
            value=1.0,
        )
    if report.scans_skipped:
        share = report.scans_skipped / (report.scans_skipped + report.scans_read)
        yield Finding(
            name="skipped",
            level=worse_if(share > OFTEN_SHARE),
            message=f"{counted(report.scans_skipped, 'scan')} cannot be read ({share:.1%}),"
            f" the first because: {report.first_fault}",
            remedy="mapping goes on without them; look at the program that writes them",
            value=float(report.scans_skipped),
        )


def _of_lasers(report: ReadReport) -> Iterator[Finding]:
    if report.places_unknown:
        yield Finding(
            name="mounting",
            level="warning",
            message=_as_read(report, "mounting", "the log does not tell where the laser sits"),
            remedy="give --laser-pose x,y,yaw_deg; or let the log tell it: in /tf_static, or in CSV"
            " columns laser_x,laser_y,laser_theta",
            value=1.0,
        )
    if report.tilt_deg:
        yield Finding(
            name="tilt",
            level="problem",
            message=_as_read(
                report, "tilt", f"the laser is tilted by {report.tilt_deg:.0f} degrees"
            ),
            remedy="choose a level laser with --topic; if the tilt in the log is wrong, give"
            " --laser-pose x,y,yaw_deg",
            value=report.tilt_deg,
        )
    if report.places_move:
        yield Finding(
            name="moving laser",
            level="problem",
            message=_as_read(report, "moving laser", "the laser moves on the base"),
            remedy="choose a fixed laser with --topic; if it is fixed indeed, give --laser-pose"
            " x,y,yaw_deg",
            value=1.0,
        )


def _as_read(report: ReadReport, name: str, otherwise: str) -> str:
    """What the reader said of each laser: it knows their frames."""
    lines = [line.removesuffix(TELL_PLACE) for line in report.found.get(name, [])]
    return "; ".join(lines) or otherwise


def _of_clocks(report: ReadReport) -> Iterator[Finding]:
    if report.stamps_replaced:
        topics = ", ".join(report.stamps_replaced)
        yield Finding(
            name="no stamps",
            level="warning",
            message=f"stamps of {topics} are zero or stand still, the time of recording is used",
            remedy="set the stamps in the driver: times of recording come late and unevenly",
            value=float(len(report.stamps_replaced)),
        )
    if report.recorded_after_s is None:
        return
    worst_s = max(report.recorded_after_s, key=abs)
    if abs(worst_s) > CLOCKS_APART_S:
        yield Finding(
            name="clocks",
            level="warning",
            message=f"stamps of scans and times of recording are up to {abs(worst_s):.1f} s apart",
            remedy="set the clocks of sensor and computer; if odometry has another clock than the"
            " scans, give --odom none",
            value=worst_s,
        )
