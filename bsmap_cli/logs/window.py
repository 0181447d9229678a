"""Which scans of a log are asked for: start, end, every n-th, no more than so many."""

from __future__ import annotations

from enum import Enum

from bsmap_cli.logs.messages import SECOND_NS
from bsmap_cli.logs.reader import ReadOptions

_LATE_IN_A_ROW = 50


class Verdict(Enum):
    """What to do with a scan."""

    TAKE = "take"
    SKIP = "skip"
    STOP = "stop"


class ScanWindow:
    """Judges scans by their stamps, in the order of the log.

    Seconds count from the first scan. Every n-th counts per topic, so that two lasers both stay.
    One stamp beyond the end does not end the log, many in a row do: real clocks jump.
    """

    def __init__(self, options: ReadOptions) -> None:
        self._start_ns = round((options.start_s or 0.0) * SECOND_NS)
        self._end_ns = None if options.end_s is None else round(options.end_s * SECOND_NS)
        self._every = max(1, options.every)
        self._left = options.max_scans
        self._first_ns: int | None = None
        self._late = 0
        self._counts: dict[str, int] = {}
        self._takes_all = (options.start_s, options.end_s, self._every, self._left) == (
            None,
            None,
            1,
            None,
        )

    def judge(self, stamp_ns: int, topic: str) -> Verdict:
        """Whether to take the next scan."""
        if self._takes_all:
            return Verdict.TAKE
        if self._left is not None and self._left <= 0:
            return Verdict.STOP
        if self._first_ns is None:
            self._first_ns = stamp_ns
        elapsed_ns = stamp_ns - self._first_ns
        if self._end_ns is not None and elapsed_ns > self._end_ns:
            self._late += 1
            return Verdict.STOP if self._late >= _LATE_IN_A_ROW else Verdict.SKIP
        self._late = 0
        if elapsed_ns < self._start_ns:
            return Verdict.SKIP
        count = self._counts.get(topic, 0)
        self._counts[topic] = count + 1
        if count % self._every:
            return Verdict.SKIP
        if self._left is not None:
            self._left -= 1
        return Verdict.TAKE
