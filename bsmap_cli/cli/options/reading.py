"""Options about the log: which scans are read, and what is known of the robot."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Literal

from bsmap_cli.cli.options.common import READING, numbers, option
from bsmap_cli.errors import UsageError

if TYPE_CHECKING:
    from bsmap_cli.geometry.se2 import SE2
    from bsmap_cli.logs.reader import ReadOptions


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadFlags:
    """Which scans of a log are read, and what is known of the robot."""

    topic: Annotated[
        list[str] | None,
        option(
            "--topic",
            "-t",
            metavar="TOPIC",
            panel=READING,
            help="Take the scans of this topic; may be repeated. Needed where a log has several.",
        ),
    ] = None
    odom: Annotated[
        str,
        option(
            "--odom",
            metavar="auto|none|tf|TOPIC",
            panel=READING,
            help="Where odometry comes from. auto: the one odometry topic, else tf, else the "
            "poses in a CARMEN or CSV log, else none.",
        ),
    ] = "auto"
    laser_pose: Annotated[
        str | None,
        option(
            "--laser-pose",
            metavar="X,Y,YAW[,flip]",
            panel=READING,
            help="The laser on the robot's base: metres, degrees; flip: mounted upside down.",
        ),
    ] = None
    base_frame: Annotated[
        str | None,
        option(
            "--base-frame",
            metavar="FRAME",
            panel=READING,
            help="The tf frame of the robot's base.",
        ),
    ] = None
    start: Annotated[
        float | None,
        option("--start", metavar="S", panel=READING, min=0.0, help="Begin so many seconds in."),
    ] = None
    end: Annotated[
        float | None,
        option(
            "--end",
            metavar="S",
            panel=READING,
            min=0.0,
            help="End so many seconds after the first scan.",
        ),
    ] = None
    duration: Annotated[
        float | None,
        option("--duration", metavar="S", panel=READING, min=0.0, help="Read so many seconds."),
    ] = None
    every: Annotated[
        int, option("--every", metavar="N", panel=READING, min=1, help="Take each N-th scan.")
    ] = 1
    max_scans: Annotated[
        int | None,
        option("--max-scans", metavar="N", panel=READING, min=1, help="Take N scans at most."),
    ] = None
    echo: Annotated[
        Literal["first", "last"],
        option(
            "--echo",
            metavar="first|last",
            panel=READING,
            help="Which echo of a MultiEchoLaserScan is taken.",
        ),
    ] = "first"
    z_min: Annotated[
        float | None,
        option("--z-min", metavar="M", panel=READING, help="Of point clouds: the lowest point."),
    ] = None
    z_max: Annotated[
        float | None,
        option("--z-max", metavar="M", panel=READING, help="Of point clouds: the highest point."),
    ] = None
    angle_min: Annotated[
        float | None,
        option(
            "--angle-min",
            metavar="DEG",
            panel=READING,
            help="Where a CSV or CARMEN log does not tell: the angle of the first beam.",
        ),
    ] = None
    angle_increment: Annotated[
        float | None,
        option(
            "--angle-increment",
            metavar="DEG",
            panel=READING,
            help="Where a CSV or CARMEN log does not tell: from one beam to the next.",
        ),
    ] = None

    def options(self) -> ReadOptions:
        """What the reader is asked for."""
        from bsmap_cli.logs.reader import ReadOptions

        self._check_finite()
        pose, flipped = parse_laser_pose(self.laser_pose)
        end_s = self._end_s()
        if end_s is not None and end_s <= (self.start or 0.0):
            raise UsageError("no time lies between the start and the end: give a later --end")
        return ReadOptions(
            topics=tuple(self.topic or ()),
            odom=self.odom,
            pose_base_laser=pose,
            laser_flipped=flipped,
            base_frame=self.base_frame,
            start_s=self.start,
            end_s=end_s,
            every=self.every,
            max_scans=self.max_scans,
            angle_min_rad=_radians(self.angle_min),
            angle_increment_rad=_radians(self.angle_increment),
            last_echo=self.echo == "last",
            z_min_m=self.z_min,
            z_max_m=self.z_max,
        )

    def _check_finite(self) -> None:
        given = {
            "--start": self.start,
            "--end": self.end,
            "--duration": self.duration,
            "--angle-min": self.angle_min,
            "--angle-increment": self.angle_increment,
            "--z-min": self.z_min,
            "--z-max": self.z_max,
        }
        for flag, value in given.items():
            if value is not None and not math.isfinite(value):
                raise UsageError(f"{flag} {value}: give a finite number")
        if self.z_min is not None and self.z_max is not None and self.z_min > self.z_max:
            raise UsageError(
                f"no height lies between --z-min {self.z_min} and --z-max {self.z_max}"
            )

    def _end_s(self) -> float | None:
        if self.duration is None:
            return self.end
        if self.end is not None:
            raise UsageError("--end and --duration say the same thing twice: give one of them")
        return (self.start or 0.0) + self.duration


def _radians(degrees: float | None) -> float | None:
    return None if degrees is None else math.radians(degrees)


def parse_laser_pose(text: str | None) -> tuple[SE2 | None, bool]:
    """The laser on the base, and whether it hangs upside down, from `x,y,yaw_deg[,flip]`."""
    from bsmap_cli.geometry.se2 import SE2

    if text is None:
        return None, False
    flipped = text.endswith(",flip")
    x, y, yaw_deg = numbers("--laser-pose", text.removesuffix(",flip"), "0.2,0,90")
    return SE2.from_array((x, y, math.radians(yaw_deg))), flipped
