"""From the decoded messages of a log to scans with motion and mounting."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.clouds import CloudSlicer
from bsmap_cli.logs.decoding import Kind
from bsmap_cli.logs.laser import STAMP_LIMIT_NS, scan_of
from bsmap_cli.logs.messages import (
    SECOND_NS,
    BadMessageError,
    CloudRecord,
    LaserRecord,
    OdometryRecord,
)
from bsmap_cli.logs.motion import Motion
from bsmap_cli.logs.mountings import Mountings
from bsmap_cli.logs.preview import Event
from bsmap_cli.logs.reader import ReadOptions, ReadReport
from bsmap_cli.logs.window import ScanWindow, Verdict
from bsmap_cli.sensor.scan import Scan

_LOOKAHEAD_NS = 2 * SECOND_NS
_LOOKAHEAD_SCANS = 512


class _Laser(NamedTuple):
    """What is fixed about the scans of one topic and frame."""

    topic: str
    pose_base_laser: SE2
    upside_down: bool
    slicer: CloudSlicer | None


class _Waiting(NamedTuple):
    """A scan that waits for odometry that is not older than it is."""

    record: LaserRecord
    laser: _Laser
    stamp_ns: int
    log_time_ns: int
    pushed: int


class ScanStream:
    """Joins scans with the odometry around them, in the order of the log.

    A scan waits until odometry as late as its stamp has come, for no longer than 2 s of log or
    512 scans. frozen : topics whose stamps are not to be believed.
    """

    def __init__(
        self,
        *,
        topics: Iterable[str],
        frozen: frozenset[str],
        motion: Motion,
        mountings: Mountings,
        options: ReadOptions,
        report: ReadReport,
    ) -> None:
        self._topics = frozenset(topics)
        self._frozen = frozen
        self._motion = motion
        self._mountings = mountings
        self._options = options
        self._report = report
        self._window = ScanWindow(options)
        self._lasers: dict[tuple[str, str], _Laser] = {}
        self._waiting: deque[_Waiting] = deque()
        self._told: set[str] = set()
        self._delays_ns: tuple[int, int] | None = None

    def scans(self, events: Iterable[Event]) -> Iterator[Scan]:
        """The scans of the chosen topics; bad ones are counted and passed over."""
        for channel, kind, log_time_ns, record in events:
            if isinstance(record, (LaserRecord, CloudRecord)):  # a union would be made each time
                if channel.topic in self._topics and not self._queue(
                    channel.topic, log_time_ns, record
                ):
                    break
            elif isinstance(record, OdometryRecord):
                self._motion.take_odometry(channel.topic, log_time_ns, record)
            elif isinstance(record, BadMessageError):
                self._pass_over(channel.topic, kind, record)
            else:
                self._motion.take_transforms(log_time_ns, record)
                self._mountings.take_late(record)
            if self._waiting:
                yield from self._settled(log_time_ns)
        yield from self._settled(None)

    def _queue(self, topic: str, log_time_ns: int, record: LaserRecord | CloudRecord) -> bool:
        """Let a scan wait for its odometry; False when no more scans are asked for."""
        stamp_ns = record.stamp_ns
        if abs(stamp_ns) >= STAMP_LIMIT_NS:
            self._pass_over(topic, Kind.SCAN, BadMessageError("a stamp beyond 64 bits"))
            return True
        if topic in self._frozen or (stamp_ns == 0 and log_time_ns != 0):
            how = "are zero" if stamp_ns == 0 else "stand still"
            if topic not in self._report.stamps_replaced:
                self._report.stamps_replaced.append(topic)
            self._report.warn(f"stamps of {topic} {how}: the time of recording is used")
            stamp_ns = log_time_ns
        else:
            self._note_delay(log_time_ns - stamp_ns)
        verdict = self._window.judge(stamp_ns, topic)
        if verdict is not Verdict.TAKE:
            return verdict is Verdict.SKIP
        laser = self._lasers.get((topic, record.frame)) or self._new_laser(topic, record)
        if isinstance(record, CloudRecord):
            try:
                assert laser.slicer is not None
                record = laser.slicer.slice(record)
            except BadMessageError as error:
                self._pass_over(topic, Kind.CLOUD, error)
                return True
        pushed = self._motion.buffer.pushed if self._motion.buffer else 0
        self._waiting.append(_Waiting(record, laser, stamp_ns, log_time_ns, pushed))
        return True

    def _note_delay(self, delay_ns: int) -> None:
        low_ns, high_ns = self._delays_ns or (delay_ns, delay_ns)
        if self._delays_ns is None or not low_ns <= delay_ns <= high_ns:
            low_ns, high_ns = min(low_ns, delay_ns), max(high_ns, delay_ns)
            self._delays_ns = low_ns, high_ns
            self._report.recorded_after_s = low_ns / SECOND_NS, high_ns / SECOND_NS

    def _settled(self, log_time_ns: int | None) -> Iterator[Scan]:
        """The scans that need not wait any longer; all of them at the end of the log (None)."""
        buffer = self._motion.buffer
        while self._waiting:
            waiting = self._waiting[0]
            pose_odom_base = None
            if buffer is not None:
                pose_odom_base = buffer.at(waiting.stamp_ns)
                if pose_odom_base is None:
                    if not self._is_over(waiting, log_time_ns):
                        return
                    pose_odom_base = buffer.interpolated(waiting.stamp_ns)
                if pose_odom_base is None:
                    self._report.warn(
                        f"no odometry ({self._motion.name}) within 1 s of some scans of"
                        f" {waiting.laser.topic}: they have none"
                    )
            self._waiting.popleft()
            scan = self._scan(waiting, pose_odom_base)
            if scan is not None:
                self._report.scans_read += 1
                yield scan

    def _is_over(self, waiting: _Waiting, log_time_ns: int | None) -> bool:
        buffer = self._motion.buffer
        return (
            log_time_ns is None
            or buffer is None
            or (buffer.pushed > waiting.pushed and buffer.reaches(waiting.stamp_ns))
            or len(self._waiting) > _LOOKAHEAD_SCANS
            or abs(log_time_ns - waiting.log_time_ns) > _LOOKAHEAD_NS
        )

    def _scan(self, waiting: _Waiting, pose_odom_base: SE2 | None) -> Scan | None:
        laser = waiting.laser
        try:
            return scan_of(
                waiting.record,
                stamp_ns=waiting.stamp_ns,
                topic=laser.topic,
                pose_base_laser=laser.pose_base_laser,
                upside_down=laser.upside_down,
                pose_odom_base=pose_odom_base,
            )
        except BadMessageError as error:
            self._pass_over(laser.topic, Kind.SCAN, error)
            return None

    def _new_laser(self, topic: str, record: LaserRecord | CloudRecord) -> _Laser:
        if isinstance(record, CloudRecord):
            mounting = self._mountings.of(record.frame)
            slicer = CloudSlicer(mounting, self._options.z_min_m, self._options.z_max_m)
            laser = _Laser(topic, slicer.pose_base_scan, False, slicer)
        else:
            mounting = self._mountings.of(record.frame, record.pose_frame_laser)
            laser = _Laser(topic, mounting.pose_base_laser, mounting.upside_down, None)
        self._lasers[topic, record.frame] = laser
        return laser

    def _pass_over(self, topic: str, kind: Kind, error: BadMessageError) -> None:
        if kind in (Kind.SCAN, Kind.CLOUD):
            if topic not in self._topics:
                return
            self._report.skip_scan(str(error))
        if topic not in self._told:
            self._told.add(topic)
            self._report.warn(f"messages of {topic} are skipped, the first because: {error}")
