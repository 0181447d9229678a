"""What readers of messages and of text have in common: one stream of scans, closed in the end."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Generator, Iterator, Sequence

from bsmap_cli.errors import LogError
from bsmap_cli.logs.reader import LogInfo, LogReader, ReadOptions, ReadReport
from bsmap_cli.logs.sources import Source
from bsmap_cli.sensor.scan import Scan


class DrawnLog(ABC):
    """A `LogReader` whose scans are drawn from one generator."""

    def __init__(self, name: str, sources: Sequence[Source], options: ReadOptions) -> None:
        self.report = ReadReport()
        self._name = name
        self._sources = sources
        self._options = options
        self._drawn: Generator[Scan, None, None] | None = None

    @property
    def is_stream(self) -> bool:
        """See `LogReader.is_stream`."""
        return any(source.path is None for source in self._sources)

    def __enter__(self) -> LogReader:
        return self

    def __exit__(self, *exc: object) -> None:
        if self._drawn is not None:
            self._drawn.close()
        for source in self._sources:
            source.close()

    def scans(self) -> Iterator[Scan]:
        """See `LogReader.scans`."""
        self._drawn = self._some()
        return self._drawn

    def _some(self) -> Generator[Scan, None, None]:
        yield from self._draw()
        if not self.report.scans_read and self._options.max_scans != 0:
            raise LogError(self._why_none())

    def _why_none(self) -> str:
        report, options = self.report, self._options
        if report.scans_skipped:
            return (
                f"none of the scans of {self._name} can be read ({report.scans_skipped} tried),"
                f" the first because: {report.first_fault}"
            )
        if report.truncated:
            return report.warnings[-1].replace("; what comes before is used", "")
        if options.start_s is None and options.end_s is None:
            return f"{self._name} holds no scan"
        return f"{self._name} holds no scan at the time asked for: see --start and --end"

    @abstractmethod
    def info(self) -> LogInfo:
        """See `LogReader.info`."""

    @abstractmethod
    def _draw(self) -> Generator[Scan, None, None]:
        """The scans, one after the other."""
