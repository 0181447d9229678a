"""What a log of messages holds, counted by its index or by reading it through."""

from __future__ import annotations

from dataclasses import dataclass

from bsmap_cli.errors import BsmapError
from bsmap_cli.logs.decoding import Kind, kind_of
from bsmap_cli.logs.messages import (
    SECOND_NS,
    Channel,
    Container,
    LaserRecord,
)
from bsmap_cli.logs.preview import Preview
from bsmap_cli.logs.reader import LogInfo, ReadReport, TopicInfo


@dataclass(slots=True)
class _Tally:
    type: str
    usable: bool
    messages: int = 0


def indexed_channels(containers: list[Container]) -> list[Channel] | None:
    """The channels that hold messages, where every container knows; else None."""
    channels: list[Channel] = []
    for container in containers:
        index = container.index()
        if index is None:
            return None
        channels.extend(channel for channel, count in index.counts.items() if count)
    return channels


class LogSurvey:
    """Counts messages and sums up; sets `preview.indexed` where the containers have indexes."""

    def __init__(self, preview: Preview, containers: list[Container]) -> None:
        self._preview = preview
        self._format = " + ".join(dict.fromkeys(container.format for container in containers))
        self._tallies: dict[str, _Tally] = {}
        self._times_ns: list[int] = []
        preview.indexed = indexed_channels(containers)
        self.is_indexed = preview.indexed is not None
        if self.is_indexed:
            self._take_indexes(containers)

    @property
    def has_scans(self) -> bool:
        """Whether a topic of scans has been counted."""
        return any(tally.usable and tally.messages for tally in self._tallies.values())

    def count(self, channel: Channel, log_time_ns: int) -> None:
        """Count one message, unless the index has done it."""
        if not self.is_indexed:
            self._tally(channel).messages += 1
            self._note(log_time_ns)

    def info(self) -> LogInfo:
        """The sum of it; `selected` is empty where the choice is left to the user."""
        report = ReadReport()
        try:
            selected = self._preview.scan_topics(report)
            odometry = self._preview.motion(selected, report).name
        except BsmapError:
            selected, odometry = (), "none"
        duration_s = (self._times_ns[1] - self._times_ns[0]) / SECOND_NS if self._times_ns else 0.0
        return LogInfo(
            format=self._format,
            duration_s=duration_s,
            topics=tuple(
                self._topic_info(topic, tally, duration_s)
                for topic, tally in sorted(self._tallies.items())
            ),
            selected=selected,
            beams=self._beams(selected),
            odometry=odometry,
        )

    def _take_indexes(self, containers: list[Container]) -> None:
        for container in containers:
            index = container.index()
            if index is None:
                continue
            for channel, count in index.counts.items():
                self._tally(channel).messages += count
            if any(index.counts.values()):
                self._note(index.start_ns)
                self._note(index.end_ns)

    def _tally(self, channel: Channel) -> _Tally:
        usable = kind_of(channel) in (Kind.SCAN, Kind.CLOUD)
        return self._tallies.setdefault(channel.topic, _Tally(channel.type, usable))

    def _note(self, time_ns: int) -> None:
        low, high = self._times_ns or (time_ns, time_ns)
        self._times_ns = [min(low, time_ns), max(high, time_ns)]

    def _topic_info(self, topic: str, tally: _Tally, duration_s: float) -> TopicInfo:
        record = self._preview.first_record(topic)
        frame = "" if record is None or isinstance(record, list) else record.frame
        intervals = tally.messages - 1
        return TopicInfo(
            topic=topic,
            type=tally.type,
            messages=tally.messages,
            rate_hz=intervals / duration_s if intervals > 0 and duration_s > 0.0 else 0.0,
            frame=frame,
            usable=tally.usable,
        )

    def _beams(self, selected: tuple[str, ...]) -> int:
        for topic in selected:
            record = self._preview.first_record(topic)
            if isinstance(record, LaserRecord):
                return len(record.ranges_m)
        return 0
