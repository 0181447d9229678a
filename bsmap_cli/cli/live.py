"""The options of a live view, and the run that is shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Protocol

from bsmap_cli.cli.options import option
from bsmap_cli.errors import UsageError

if TYPE_CHECKING:
    from bsmap_cli.cli.mapmaking import Work
    from bsmap_cli.cli.talk import Talk
    from bsmap_cli.config import Settings
    from bsmap_cli.logs.reader import LogReader
    from bsmap_cli.pipeline import Onlooker, Progress, Run

LIVE = "Live view"
PORT, WAIT_S = 8765, 5.0


class WatchedWork(Protocol):
    """Makes a map from a log, and shows how."""

    def __call__(
        self,
        reader: LogReader,
        settings: Settings,
        progress: Progress,
        onlooker: Onlooker | None = None,
        /,
    ) -> Run:
        """Make the map."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveFlags:
    """Whether a run is shown in Foxglove while it goes on."""

    live: Annotated[
        bool,
        option(
            "--live",
            panel=LIVE,
            help="Show scans, curves and path in Foxglove, over a websocket on 127.0.0.1.",
        ),
    ] = False
    live_port: Annotated[
        int | None,
        option(
            "--live-port",
            metavar="PORT",
            panel=LIVE,
            min=0,
            max=65535,
            help=f"Where Foxglove connects: {PORT}; 0: a free port.",
        ),
    ] = None
    live_wait: Annotated[
        float | None,
        option(
            "--live-wait",
            metavar="S",
            panel=LIVE,
            min=0.0,
            help=f"How long to wait for Foxglove before the first scan: {WAIT_S:g} s.",
        ),
    ] = None

    def watched(self, work: WatchedWork, talk: Talk) -> Work:
        """How the map is made: looked at or not, it is the same map."""
        if not self.live:
            if self.live_port is not None or self.live_wait is not None:
                raise UsageError("--live-port and --live-wait are about the live view: add --live")
            return work

        def shown(reader: LogReader, settings: Settings, progress: Progress) -> Run:
            from bsmap_cli.cli.progress import STARTING
            from bsmap_cli.exchange.live_view import LiveView

            with LiveView(PORT if self.live_port is None else self.live_port) as view:
                talk.note(f"live view: open {view.address} in Foxglove")
                progress.stage("waiting for Foxglove")
                if not view.wait(WAIT_S if self.live_wait is None else self.live_wait):
                    talk.note("live view: nobody looks yet; the run goes on")
                progress.stage(STARTING)
                return work(reader, settings, progress, view)

        return shown
