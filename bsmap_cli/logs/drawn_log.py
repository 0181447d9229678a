"""What readers of messages and of text have in common: one stream of scans, closed in the end."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Generator, Iterator, Sequence

from bsmap_cli.logs.reader import LogInfo, LogReader, ReadReport
from bsmap_cli.logs.sources import Source
from bsmap_cli.sensor.scan import Scan


class DrawnLog(ABC):
    """A `LogReader` whose scans are drawn from one generator."""

    def __init__(self, sources: Sequence[Source]) -> None:
        self.report = ReadReport()
        self._sources = sources
        self._drawn: Generator[Scan, None, None] | None = None

    def __enter__(self) -> LogReader:
        return self

    def __exit__(self, *exc: object) -> None:
        if self._drawn is not None:
            self._drawn.close()
        for source in self._sources:
            source.close()

    def scans(self) -> Iterator[Scan]:
        """See `LogReader.scans`."""
        self._drawn = self._draw()
        return self._drawn

    @abstractmethod
    def info(self) -> LogInfo:
        """See `LogReader.info`."""

    @abstractmethod
    def _draw(self) -> Generator[Scan, None, None]:
        """The scans, one after the other."""
