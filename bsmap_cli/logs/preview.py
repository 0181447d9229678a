"""The first seconds of a log of messages, on which topics, motion and mountings are judged."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from bsmap_cli.errors import LogError, UsageError
from bsmap_cli.logs.decoding import Kind, kind_of
from bsmap_cli.logs.messages import (
    SECOND_NS,
    BadMessageError,
    Channel,
    CloudRecord,
    LaserRecord,
    OdometryRecord,
    Record,
)
from bsmap_cli.logs.motion import Motion, NoMotion, OdometryTopic, TransformMotion
from bsmap_cli.logs.reader import ReadOptions, ReadReport
from bsmap_cli.logs.topics import choose_odometry_topic, choose_scan_topics
from bsmap_cli.logs.transforms import TransformTree, is_base, is_odom

PREVIEW_NS = 2 * SECOND_NS
SCANS = (Kind.SCAN, Kind.CLOUD)
_PREVIEW_SCANS = 1000
_PREVIEW_MESSAGES = 50_000
_CONSTANT_STAMPS = 5


class Event(NamedTuple):
    """A decoded message, or why it could not be decoded."""

    channel: Channel
    kind: Kind
    log_time_ns: int
    record: Record | BadMessageError


@dataclass(slots=True)
class Preview:
    """Buffered events, and what they say about the log.

    indexed : all channels that hold messages, where the containers know them beforehand.
    declared : all channels met so far, by topic, of use or not.
    """

    name: str
    options: ReadOptions
    indexed: list[Channel] | None = None
    events: list[Event] = field(default_factory=list)
    seen: dict[str, Channel] = field(default_factory=dict)
    declared: dict[str, Channel] = field(default_factory=dict)
    tree: TransformTree = field(default_factory=TransformTree)
    _first_ns: int | None = None
    _scans: int = 0

    def add(self, event: Event) -> bool:
        """Buffer an event; True when enough of the log has been seen to judge it."""
        self.events.append(event)
        self.seen.setdefault(event.channel.topic, event.channel)
        if self._first_ns is None:
            self._first_ns = event.log_time_ns
        if event.kind is Kind.TRANSFORMS and isinstance(event.record, list):
            for record in event.record:
                self.tree.add(record)
        self._scans += event.kind in SCANS
        if self._scans >= _PREVIEW_SCANS or len(self.events) >= _PREVIEW_MESSAGES:
            return True
        is_late = abs(event.log_time_ns - self._first_ns) >= PREVIEW_NS
        return is_late and self._is_scan_seen() and not self._is_place_to_come()

    def _is_scan_seen(self) -> bool:
        asked = self.options.topics
        if self.indexed is not None or not asked:
            return self._scans > 0
        return all(topic in self.seen or f"/{topic}" in self.seen for topic in asked)

    def _is_place_to_come(self) -> bool:
        """Whether a laser has no place yet, and the index tells of transforms that were not met."""
        to_come = (c for c in self.indexed or () if kind_of(c) is Kind.TRANSFORMS)
        return any(c.topic not in self.seen for c in to_come) and self.lacks_place

    @property
    def lacks_place(self) -> bool:
        """Whether the place of some laser was neither met nor told."""
        if self.options.pose_base_laser is not None:
            return False
        records = (self.first_record(c.topic) for c in self.seen.values() if kind_of(c) in SCANS)
        frames = {r.frame for r in records if isinstance(r, LaserRecord | CloudRecord)}
        return any(not is_base(f) and len(self.tree.ancestors(f)) == 1 for f in frames)

    def scan_topics(self, report: ReadReport) -> tuple[str, ...]:
        """The topics to read; see `choose_scan_topics`."""
        if not self.events and report.truncated:
            raise LogError(report.warnings[-1].replace("; what comes before is used", ""))
        channels = self._channels()
        known = self.declared.values() if self.indexed is None else self.indexed
        types = {channel.topic: channel.type for channel in known}
        return choose_scan_topics(self.name, _kinds(channels), types, self.options.topics)

    def motion(self, scan_topics: tuple[str, ...], report: ReadReport) -> Motion:
        """What moves the base, as `--odom` asks; says in `report` what was chosen and why."""
        asked = self.options.odom
        motion: Motion = NoMotion()
        if asked == "tf":
            motion = self._transform_motion(scan_topics) or self._no_transforms()
        elif asked != "none":
            kinds = _kinds(self._channels())
            if asked == "auto":
                kinds = {topic: k for topic, k in kinds.items() if self._is_odometry(topic, k)}
            topic, candidates = choose_odometry_topic(self.name, kinds, asked)
            if topic is not None:
                motion = self._odometry_topic(topic, report)
            else:
                motion = self._transform_motion(scan_topics) or motion
            if motion.buffer is None and candidates:
                listed = ", ".join(candidates)
                report.warn(f"several odometry topics ({listed}): choose one with --odom TOPIC")
        report.odometry = motion.name
        return motion

    def base_frame(self, motion: Motion) -> str | None:
        """The base, where the user or the motion names it."""
        return (self.options.base_frame or "").removeprefix("/") or motion.base_frame

    def is_frozen(self, topic: str) -> bool:
        """Whether the stamps of a topic stand still while the times of recording do not."""
        pairs = [
            (event.record.stamp_ns, event.log_time_ns)
            for event in self.events
            if event.channel.topic == topic
            and isinstance(event.record, LaserRecord | CloudRecord | OdometryRecord)
        ]
        stamps, times = {stamp for stamp, _ in pairs}, {time for _, time in pairs}
        return len(pairs) >= _CONSTANT_STAMPS and len(stamps) == 1 and len(times) > 1

    def _channels(self) -> list[Channel]:
        return list(self.seen.values()) if self.indexed is None else self.indexed

    def _is_odometry(self, topic: str, kind: Kind | None) -> bool:
        """A pose of foxglove's counts only where its frame is an odometry frame."""
        channel = self.seen.get(topic)
        if kind is not Kind.ODOMETRY or channel is None or channel.type == "nav_msgs/msg/Odometry":
            return kind is Kind.ODOMETRY
        record = self.first_record(topic)
        return isinstance(record, OdometryRecord) and is_odom(record.frame)

    def first_record(self, topic: str) -> Record | None:
        """The first message of a topic that could be decoded."""
        for event in self.events:
            if event.channel.topic == topic and not isinstance(event.record, BadMessageError):
                return event.record
        return None

    def _odometry_topic(self, topic: str, report: ReadReport) -> Motion:
        record = self.first_record(topic)
        child = record.child_frame if isinstance(record, OdometryRecord) else None
        base = (self.options.base_frame or "").removeprefix("/") or None
        return OdometryTopic(topic, child, base, self.tree, report, self.is_frozen(topic))

    def _transform_motion(self, scan_topics: tuple[str, ...]) -> Motion | None:
        records = [self.first_record(topic) for topic in scan_topics]
        frames = [r.frame for r in records if r is not None and not isinstance(r, list)]
        base = (self.options.base_frame or "").removeprefix("/")
        if base:
            odom = next((f for f in self.tree.ancestors(base)[1:] if is_odom(f)), None)
            return TransformMotion(self.tree, odom, base) if odom else None
        found = self.tree.base_under_odom(frames)
        return TransformMotion(self.tree, *found) if found else None

    def _no_transforms(self) -> Motion:
        base = self.options.base_frame or "a base"
        raise UsageError(f"{self.name} has no tf from odom to {base}: leave out --odom tf")


def _kinds(channels: list[Channel]) -> dict[str, Kind | None]:
    kinds: dict[str, Kind | None] = {}
    for channel in channels:
        kinds[channel.topic] = kinds.get(channel.topic) or kind_of(channel)
    return kinds
