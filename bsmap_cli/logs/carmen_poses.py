"""Poses for raw scans of CARMEN logs, from the `ODOM` lines around them."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from bsmap_cli.logs.carmen_lines import OdomLine, ScanLine
from bsmap_cli.logs.messages import SECOND_NS, BadMessageError
from bsmap_cli.logs.odometry import OdometryBuffer

_LOOKAHEAD_SCANS = 512
_LOOKAHEAD_NS = 2 * SECOND_NS


class _Waiting(NamedTuple):
    """A line that waits for odometry; pushed : how many poses had come before it."""

    line: ScanLine | BadMessageError
    pushed: int


def with_poses(
    lines: Iterable[ScanLine | OdomLine | BadMessageError],
) -> Iterator[ScanLine | BadMessageError]:
    """The lines in their order; a scan waits for odometry behind it that is as late as its stamp.

    It waits for no longer than 2 s or 512 scans of log; without odometry near by it has none.
    """
    buffer = OdometryBuffer()
    waiting: deque[_Waiting] = deque()
    newest_ns = 0
    for line in lines:
        if isinstance(line, OdomLine):
            buffer.push(line.stamp_ns, *line.robot)
            newest_ns = line.stamp_ns
        else:
            waiting.append(_Waiting(line, buffer.pushed))
            if isinstance(line, ScanLine):
                newest_ns = line.record.stamp_ns
        while waiting and (
            len(waiting) > _LOOKAHEAD_SCANS or _is_settled(waiting[0], buffer, newest_ns)
        ):
            yield _posed(waiting.popleft().line, buffer)
    while waiting:
        yield _posed(waiting.popleft().line, buffer)


def _is_settled(waiting: _Waiting, buffer: OdometryBuffer, newest_ns: int) -> bool:
    line, pushed = waiting
    if isinstance(line, BadMessageError) or line.robot is not None:
        return True
    stamp_ns = line.record.stamp_ns
    return (
        buffer.at(stamp_ns) is not None
        or (buffer.pushed > pushed and buffer.reaches(stamp_ns))
        or abs(newest_ns - stamp_ns) > _LOOKAHEAD_NS
    )


def _posed(line: ScanLine | BadMessageError, buffer: OdometryBuffer) -> ScanLine | BadMessageError:
    if isinstance(line, BadMessageError) or line.robot is not None:
        return line
    pose = buffer.interpolated(line.record.stamp_ns)
    return line if pose is None else line._replace(robot=(pose.x, pose.y, pose.theta))
