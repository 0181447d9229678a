"""The scans of a log on their way into the method: counted, timed, and told of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from bsmap_cli.errors import LogError
from bsmap_cli.logs.read_ahead import scans_ahead
from bsmap_cli.logs.reader import LogReader
from bsmap_cli.sensor.scan import Scan

if TYPE_CHECKING:
    from bsmap_cli.mapping.map_document import MapDocument
    from bsmap_cli.sensor.trajectory import Trajectory
    from bsmap_cli.slam.slam import Slam


MOST_AHEAD = 64  # scans that are read at a time


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

    cores : with more than one, a process beside this one reads the log, where that can be.
    read_s : time that reading took [s]; sensor : what the first scan tells of the lidar.
    """

    reader: LogReader
    progress: Progress
    cores: int = 1
    read_s: float = 0.0
    count: int = 0
    first_ns: int = 0
    last_ns: int = 0
    sensor: dict[str, Any] | None = None

    def __iter__(self) -> Iterator[Scan]:
        for scan in self._read():
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

    def _read(self) -> Iterator[Scan]:
        """The scans, read some at a time: what is done over and over stays in the caches.

        From a stream they come one by one, as the next may not be written yet. Where reading
        fails, the scans before come first.
        """
        most = 1 if self.reader.is_stream else MOST_AHEAD
        source = scans_ahead(self.reader) if self.cores > 1 else self.reader.scans()
        failure: Exception | None = None
        ended = False
        while not ended:
            began = perf_counter()
            ahead: list[Scan] = []
            try:
                while len(ahead) < most and not ended:
                    scan = next(source, None)
                    if scan is None:
                        ended = True
                    else:
                        ahead.append(scan)
            except Exception as error:  # told once the scans before it are through
                ended, failure = True, error
            self.read_s += perf_counter() - began
            yield from ahead
        if failure:
            raise failure

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
