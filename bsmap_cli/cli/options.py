"""The registry of options: what several commands share is declared once, here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bsmap_cli.cli.talk import ColorMode, Talk
from bsmap_cli.errors import UsageError

if TYPE_CHECKING:
    from bsmap_cli.config import Settings
    from bsmap_cli.geometry.se2 import SE2
    from bsmap_cli.logs.reader import ReadOptions

READING, SETTINGS, SENSOR, TALKING = "Reading the log", "Settings", "Sensor", "Messages"


def option(*names: str, metavar: str | None = None, panel: str | None = None, **more: Any) -> Any:
    """One option of the registry."""
    return typer.Option(*names, metavar=metavar, rich_help_panel=panel, **more)


Logs = Annotated[
    list[str] | None,
    typer.Argument(
        metavar="LOG...",
        help="Log files, the parts of one run in order, or a folder; `-` or nothing where "
        "standard input is a pipe: standard input.",
    ),
]
MapIn = Annotated[
    str | None,
    typer.Argument(
        metavar="MAP",
        help="A map file; `-` or nothing where standard input is a pipe: standard input.",
    ),
]
Force = Annotated[bool, option("--force", "-f", help="Replace output files that exist.")]
Strict = Annotated[
    bool,
    option("--strict", help="Fail (exit 1) and write nothing where something was lost."),
]
Json = Annotated[bool, option("--json", help="Print the report as one JSON document.")]
TrajectoryOut = Annotated[
    str | None,
    option(
        "--traj",
        metavar="FILE",
        help="Also write the trajectory, a line a scan: TUM (stamp x y z qx qy qz qw), or "
        ".csv, .json, .kitti by extension.",
    ),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class TalkFlags:
    """How much is said on standard error."""

    quiet: Annotated[
        bool,
        option("--quiet", "-q", panel=TALKING, help="Say only what went wrong or was lost."),
    ] = False
    verbose: Annotated[
        int,
        option(
            "--verbose",
            "-v",
            panel=TALKING,
            count=True,
            show_default=False,
            help="Say more; -vv adds debug lines and tracebacks.",
        ),
    ] = 0
    color: Annotated[
        ColorMode,
        option(
            "--color",
            metavar="auto|always|never",
            panel=TALKING,
            help="Color the messages; auto: on a terminal unless NO_COLOR is set.",
        ),
    ] = "auto"

    def talk(self) -> Talk:
        """The voice these flags ask for."""
        return Talk(level=-1 if self.quiet and not self.verbose else self.verbose, color=self.color)


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
        option("--start", metavar="S", panel=READING, help="Begin so many seconds in."),
    ] = None
    end: Annotated[
        float | None,
        option(
            "--end", metavar="S", panel=READING, help="End so many seconds after the first scan."
        ),
    ] = None
    duration: Annotated[
        float | None,
        option("--duration", metavar="S", panel=READING, help="Read so many seconds."),
    ] = None
    every: Annotated[
        int, option("--every", metavar="N", panel=READING, min=1, help="Take each N-th scan.")
    ] = 1
    max_scans: Annotated[
        int | None,
        option("--max-scans", metavar="N", panel=READING, min=1, help="Take N scans at most."),
    ] = None

    def options(self) -> ReadOptions:
        """What the reader is asked for."""
        from bsmap_cli.logs.reader import ReadOptions

        pose, flipped = parse_laser_pose(self.laser_pose)
        return ReadOptions(
            topics=tuple(self.topic or ()),
            odom=self.odom,
            pose_base_laser=pose,
            laser_flipped=flipped,
            base_frame=self.base_frame,
            start_s=self.start,
            end_s=self._end_s(),
            every=self.every,
            max_scans=self.max_scans,
        )

    def _end_s(self) -> float | None:
        if self.duration is None:
            return self.end
        if self.end is not None:
            raise UsageError("--end and --duration say the same thing twice: give one of them")
        return (self.start or 0.0) + self.duration


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingsFlags:
    """Settings: built-in < profile < file < --set."""

    profile: Annotated[
        str,
        option(
            "--profile",
            metavar="NAME",
            panel=SETTINGS,
            help="Start from a named set of settings: default, or paper (as printed).",
        ),
    ] = "default"
    config: Annotated[
        str | None,
        option(
            "--config",
            "-c",
            metavar="FILE",
            panel=SETTINGS,
            help="Read settings from a YAML file; `bsmap config init` writes one.",
        ),
    ] = None
    set_: Annotated[
        list[str] | None,
        option(
            "--set",
            metavar="KEY=VALUE",
            panel=SETTINGS,
            help="Change one setting, such as ladder=[0.2,0.1]; may be repeated.",
        ),
    ] = None

    def settings(self, extra: tuple[str, ...] = ()) -> Settings:
        """The settings these flags ask for; `extra` overrides come last."""
        from bsmap_cli.config import load_settings

        return load_settings(self.profile, self.config, (*(self.set_ or ()), *extra))


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorFlags:
    """Short names for settings of the sensor."""

    range_: Annotated[
        str | None,
        option(
            "--range",
            metavar="MIN,MAX",
            panel=SENSOR,
            help="Use returns between these distances [m] only.",
        ),
    ] = None
    ignore_angles: Annotated[
        list[str] | None,
        option(
            "--ignore-angles",
            metavar="A,B",
            panel=SENSOR,
            help="Ignore beams from A to B degrees, where the robot sees itself; repeatable.",
        ),
    ] = None

    def overrides(self) -> tuple[str, ...]:
        """The same as `key=value` overrides."""
        given = []
        if self.range_ is not None:
            near, far = numbers("--range", self.range_, 2)
            given += [f"sensor.range_min_m={near!r}", f"sensor.range_max_m={far!r}"]
        if self.ignore_angles:
            pairs = [numbers("--ignore-angles", pair, 2) for pair in self.ignore_angles]
            given.append(f"sensor.ignore_angles_deg={pairs}")
        return tuple(given)


def numbers(name: str, text: str, count: int) -> list[float]:
    """`count` finite numbers separated by commas; UsageError otherwise."""
    import math

    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) != count or not all(math.isfinite(value) for value in values):
        example = ",".join(["0.1", "30", "0", "1"][:count])
        raise UsageError(f"{name} {text}: give {count} numbers with commas, such as {example}")
    return values


def parse_laser_pose(text: str | None) -> tuple[SE2 | None, bool]:
    """The laser on the base, and whether it hangs upside down, from `x,y,yaw_deg[,flip]`."""
    from math import radians

    from bsmap_cli.geometry.se2 import SE2

    if text is None:
        return None, False
    flipped = text.endswith(",flip")
    x, y, yaw_deg = numbers("--laser-pose", text.removesuffix(",flip"), 3)
    return SE2.from_array((x, y, radians(yaw_deg))), flipped
