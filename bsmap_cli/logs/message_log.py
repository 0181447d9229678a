"""A log of messages, in one file or several: MCAP, ROS 1 bag, ROS 2 bag."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Sequence
from contextlib import closing
from itertools import chain

from bsmap_cli.logs.decoding import Decoder, Kind, decoder_for, kind_of
from bsmap_cli.logs.drawn_log import DrawnLog
from bsmap_cli.logs.message_info import LogSurvey, indexed_channels
from bsmap_cli.logs.messages import BadMessageError, Channel, Container, RawMessage
from bsmap_cli.logs.mountings import Mountings
from bsmap_cli.logs.preview import Event, Preview
from bsmap_cli.logs.reader import LogInfo, ReadOptions
from bsmap_cli.logs.scan_stream import ScanStream
from bsmap_cli.logs.sources import Source
from bsmap_cli.sensor.scan import Scan


class MessageLog(DrawnLog):
    """Streams the scans of containers that are the parts of one run; see `LogReader`."""

    def __init__(
        self,
        name: str,
        sources: Sequence[Source],
        containers: list[Container],
        options: ReadOptions,
    ) -> None:
        super().__init__(name, sources, options)
        self._containers = containers
        self._preview = Preview(name, options)
        self._decoders: dict[Channel, tuple[Kind, Decoder]] = {}
        self._needed: frozenset[str | None] | None = None

    def info(self) -> LogInfo:
        """See `LogReader.info`; with an index only the first seconds are read."""
        survey = LogSurvey(self._preview, self._containers)
        is_judged = survey.is_indexed and not survey.has_scans
        with closing(self._raw(wants_all=True)) as messages:
            for channel, log_time_ns, payload in messages:
                if is_judged and survey.is_indexed:
                    break
                survey.count(channel, log_time_ns)
                if not is_judged and channel in self._decoders:
                    is_judged = self._preview.add(
                        _decoded(*self._decoders[channel], channel, log_time_ns, payload)
                    )
        return survey.info()

    def _draw(self) -> Generator[Scan, None, None]:
        preview = self._preview
        preview.indexed = indexed_channels(self._containers)
        with closing(self._events()) as events:
            for event in events:
                if preview.add(event):
                    break
            stream = self._stream()
            yield from stream.scans(chain(_emptied(preview.events), events))

    def _stream(self) -> ScanStream:
        preview, report = self._preview, self.report
        topics = preview.scan_topics(report)
        motion = preview.motion(topics, report)
        mountings = Mountings(preview.tree, preview.base_frame(motion), self._options, report)
        frozen = frozenset(topic for topic in topics if preview.is_frozen(topic))
        transforms = (None,) if preview.lacks_place else ()
        self._keep_only(frozenset((*topics, motion.topic, *transforms)))
        return ScanStream(
            topics=topics,
            frozen=frozen,
            motion=motion,
            mountings=mountings,
            options=self._options,
            report=report,
        )

    def _keep_only(self, topics: frozenset[str | None]) -> None:
        """Stop decoding what was not chosen; None among the topics stands for transforms."""
        self._needed = topics
        self._decoders = {
            channel: (kind, decoder)
            for channel, (kind, decoder) in self._decoders.items()
            if self._is_needed(channel, kind)
        }

    def _is_needed(self, channel: Channel, kind: Kind) -> bool:
        if self._needed is None:
            return True
        return (None if kind is Kind.TRANSFORMS else channel.topic) in self._needed

    def _events(self) -> Generator[Event, None, None]:
        with closing(self._raw(wants_all=False)) as messages:
            for channel, log_time_ns, payload in messages:
                found = self._decoders.get(channel)
                if found is not None:
                    yield _decoded(*found, channel, log_time_ns, payload)

    def _raw(self, *, wants_all: bool) -> Generator[RawMessage, None, None]:
        def wants(channel: Channel) -> bool:
            self._preview.declared.setdefault(channel.topic, channel)
            kind = kind_of(channel)
            if kind is not None and self._is_needed(channel, kind):
                decoder = decoder_for(channel, last_echo=self._options.last_echo)
                self._decoders[channel] = kind, decoder
            return wants_all or channel in self._decoders

        for container in self._containers:
            yield from container.messages(wants, self.report)


def _decoded(
    kind: Kind,
    decode: Decoder,
    channel: Channel,
    log_time_ns: int,
    payload: bytes | memoryview,
) -> Event:
    try:
        return Event(channel, kind, log_time_ns, decode(payload))
    except BadMessageError as error:
        return Event(channel, kind, log_time_ns, error)


def _emptied(events: list[Event]) -> Iterator[Event]:
    """The events in their order, each forgotten as it is drawn."""
    events.reverse()
    while events:
        yield events.pop()
