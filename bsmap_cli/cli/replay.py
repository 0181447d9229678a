"""Scans that a viewer shows along a path: the log they come from."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from bsmap_cli.cli.door import DONE
from bsmap_cli.cli.losses import exit_code, reading_losses, tell_warnings
from bsmap_cli.cli.options import option, parse_laser_pose
from bsmap_cli.cli.talk import Talk
from bsmap_cli.errors import UsageError

if TYPE_CHECKING:
    from bsmap_cli.sensor.scan import Scan

REPLAY = "Replay"


@dataclass(slots=True)
class Replayed:
    """The scans of a log, and once they were used the exit code that its reading calls for."""

    scans: Iterator[Scan]
    code: int = DONE


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayFlags:
    """The log whose scans are shown along the path."""

    log: Annotated[
        str | None,
        option("--log", metavar="LOG", panel=REPLAY, help="Also the scans of this log, on --traj."),
    ] = None
    topic: Annotated[
        list[str] | None,
        option("--topic", "-t", metavar="TOPIC", panel=REPLAY, help="The scans of this topic."),
    ] = None
    laser_pose: Annotated[
        str | None,
        option(
            "--laser-pose",
            metavar="X,Y,YAW[,flip]",
            panel=REPLAY,
            help="The laser on the robot's base: metres, degrees.",
        ),
    ] = None

    def check(self, traj: str | None) -> None:
        """Refuse flags that would do nothing."""
        if self.log is not None and traj is None:
            raise UsageError("--log replays scans along a path with stamps: give that with --traj")
        if self.log is None and (self.topic or self.laser_pose):
            raise UsageError("--topic and --laser-pose are about the log: give that with --log")

    @contextmanager
    def scans(self, talk: Talk) -> Iterator[Replayed]:
        """The scans of the log, none where there is no log; what the reader says is passed on."""
        if self.log is None:
            yield Replayed(iter(()))
            return
        from bsmap_cli.logs.open_log import open_log
        from bsmap_cli.logs.reader import ReadOptions

        pose, flipped = parse_laser_pose(self.laser_pose)
        options = ReadOptions(
            topics=tuple(self.topic or ()), pose_base_laser=pose, laser_flipped=flipped
        )
        with open_log([self.log], options) as reader:
            replayed = Replayed(reader.scans())
            yield replayed
            tell_warnings(reader.report, talk)
            replayed.code = exit_code(reading_losses(reader.report), strict=False, talk=talk)
