"""What every log reader offers, whatever the format behind it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.scan import Scan

WARNINGS_LIMIT = 50
"""A log that is wrong in ever new ways must not fill the screen."""
TELL_PLACE = " (tell its place with --laser-pose x,y,yaw_deg)"


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadOptions:
    """What the user asks of a log; see the shared flags of the command line.

    start_s, end_s : seconds after the first scan.
    odom : "auto", "none", "tf" or a topic.
    """

    topics: tuple[str, ...] = ()
    odom: str = "auto"
    pose_base_laser: SE2 | None = None
    laser_flipped: bool = False
    base_frame: str | None = None
    start_s: float | None = None
    end_s: float | None = None
    every: int = 1
    max_scans: int | None = None
    angle_min_rad: float | None = None
    angle_increment_rad: float | None = None
    last_echo: bool = False
    z_min_m: float | None = None
    z_max_m: float | None = None


@dataclass(slots=True, kw_only=True)
class ReadReport:
    """What happened while reading: filled as the scans are drawn.

    scans_read : scans handed out.
    scans_skipped : scans, of the chosen topics, that could not be read.
    first_fault : what was wrong with the first of them.
    truncated : part of the log is missing or damaged.
    odometry : what moves the base, in a few words.
    places_unknown : whether the place of a laser was neither in the log nor told.
    places_move : whether a laser was seen to move on its base.
    tilt_deg : of the most tilted laser, 0 where all are level enough.
    stamps_replaced : topics some of whose stamps are not believed.
    recorded_after_s : least and greatest time of recording minus stamp [s], where the log has
        both.
    warnings : one line each, for the user, without repetition.
    found : those of them that are findings of `check_log`, by the finding's name.
    """

    scans_read: int = 0
    scans_skipped: int = 0
    first_fault: str = ""
    truncated: bool = False
    odometry: str = "none"
    places_unknown: bool = False
    places_move: bool = False
    tilt_deg: float = 0.0
    stamps_replaced: list[str] = field(default_factory=list)
    recorded_after_s: tuple[float, float] | None = None
    warnings: list[str] = field(default_factory=list)
    found: dict[str, list[str]] = field(default_factory=dict)

    def skip_scan(self, fault: str) -> None:
        """Count a scan that cannot be read."""
        self.first_fault = self.first_fault or fault
        self.scans_skipped += 1

    def warn(self, line: str, *, finding: str = "") -> None:
        """Tell the user once; `finding` is the name of the finding that says the same."""
        if line not in self.warnings and len(self.warnings) < WARNINGS_LIMIT:
            self.warnings.append(line)
            if finding:
                self.found.setdefault(finding, []).append(line)

    def lose(self, line: str) -> None:
        """Tell the user that part of the log is missing or damaged."""
        self.truncated = True
        self.warn(line)


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicInfo:
    """One stream of messages in a log."""

    topic: str
    type: str
    messages: int
    rate_hz: float
    frame: str
    usable: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class LogInfo:
    """What a log holds and what `slam` would take from it."""

    format: str
    duration_s: float
    topics: tuple[TopicInfo, ...]
    selected: tuple[str, ...]
    beams: int
    odometry: str


class LogReader(Protocol):
    """A context manager that streams the scans of one log, once, in the order of the log."""

    report: ReadReport

    @property
    def is_stream(self) -> bool:
        """Whether the next scan may not be written yet."""
        ...

    def __enter__(self) -> LogReader: ...

    def __exit__(self, *exc: object) -> None: ...

    def scans(self) -> Iterator[Scan]:
        """The scans, one at a time; a bad one is counted in `report` and skipped.

        Raises LogError where not a single one can be read, or the choice is the user's.
        """
        ...

    def info(self) -> LogInfo:
        """What the log holds; reads it to the end where the format has no index."""
        ...
