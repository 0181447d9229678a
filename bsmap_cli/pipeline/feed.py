"""The scans of a log on their way into the method: counted, timed, and told of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from bsmap_cli.errors import LogError
from bsmap_cli.logs.reader import LogReader
from bsmap_cli.sensor.scan import Scan

if TYPE_CHECKING:
    from bsmap_cli.mapping.map_document import MapDocument
    from bsmap_cli.sensor.trajectory import Trajectory
    from bsmap_cli.slam.slam import Slam


class Progress(Protocol):
    """Who is told how far a run has come."""

    def scans(self, count: int, span_s: float) -> None:
        """`count` scans are through, which span so many seconds of the log."""

    def stage(self, name: str) -> None:
        """The run turns to another task."""


class Onlooker(Protocol):
    """Who is shown a run while it goes on."""

    def scan(self, scan: Scan, slam: Slam) -> None:
        """A scan is through."""

    def finished(self, document: MapDocument, trajectory: Trajectory) -> None:
        """The map is finished."""


class Silent:
    """A `Progress` that tells nobody."""

    def scans(self, count: int, span_s: float) -> None:
        """Say nothing."""

    def stage(self, name: str) -> None:
        """Say nothing."""


@dataclass(slots=True)
class Feed:
    """Draws the scans of a reader once; what it remembers does not grow with their number.

    read_s : time that reading took [s]; sensor : what the first scan tells of the lidar.
    """

    reader: LogReader
    progress: Progress
    read_s: float = 0.0
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0
    sensor: dict[str, Any] | None = None

    def __iter__(self) -> Iterator[Scan]:
        source = iter(self.reader.scans())
        while True:
            began = perf_counter()
            scan = next(source, None)
            self.read_s += perf_counter() - began
            if scan is None:
                break
            if self.sensor is None:
                self.first_ns, self.sensor = scan.stamp_ns, _sensor(scan)
            self.count += 1
            self.last_ns = scan.stamp_ns
            yield scan
            self.progress.scans(self.count, self.span_s)
        if not self.count:
            raise LogError(
                "the log holds no usable scan: see `bsmap check`, and --start, --end and --topic"
            )

    @property
    def span_s(self) -> float:
        """Time from the first scan to the last [s]."""
        return (self.last_ns - self.first_ns) / 1e9


def _sensor(scan: Scan) -> dict[str, Any]:
    return {
        "beams": len(scan.ranges_m),
        "angle_min_deg": round(float(np.degrees(scan.angle_min_rad)), 4),
        "angle_increment_deg": round(float(np.degrees(scan.angle_increment_rad)), 6),
    }
