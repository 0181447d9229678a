"""A run shown in Foxglove while it goes on: scans, curves and path over a websocket.

What is shown is thinned by the clock, so that watching does not slow the run down; what the run
makes does not depend on it.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from bsmap_cli.errors import BsmapError
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.freeze import freeze_level

if TYPE_CHECKING:
    from bsmap_cli.mapping.map_document import MapDocument
    from bsmap_cli.sensor.scan import Scan
    from bsmap_cli.sensor.trajectory import Trajectory
    from bsmap_cli.slam.slam import Slam
    from bsmap_cli.slam.slam_view import SlamView

HOST = "127.0.0.1"
SCANS_EVERY_S, CURVES_EVERY_S = 1 / 30, 1 / 4
LONGEST_PATH = 5000  # poses
LATEST_NS = 2**32 * 1_000_000_000 - 1  # what a timestamp of the viewer holds
POLL_S, DELIVERY_S = 0.02, 0.5


class LiveView:
    """A server on this machine; it can be used as a context manager, which stops it.

    Curves are sent once for each submap, in the submap's own frame: a loop closure moves frames.
    """

    def __init__(self, port: int) -> None:
        """Listen on a port of 127.0.0.1, any free one where it is 0.

        BsmapError where the port is taken, or the Foxglove SDK is not installed.
        """
        try:
            import foxglove
            from foxglove.websocket import Capability

            from bsmap_cli.exchange import live_messages
        except ImportError as error:
            raise BsmapError("the live view needs its extra: pip install 'bsmap[live]'") from error
        self._make = live_messages
        context = self._context = foxglove.Context()  # channels end with it
        self._channels = _Channels(context)
        self._joined = _Joined()
        listener: Any = self._joined  # what it does not define is not called
        try:
            self._server = foxglove.start_server(
                name="bsmap",
                host=HOST,
                port=port,
                context=context,
                capabilities=[Capability.Time],
                server_listener=listener,
            )
        except (RuntimeError, OSError) as error:
            reason = str(error).rpartition(": ")[2]
            raise BsmapError(
                f"nothing can be served on port {port} of {HOST}: {reason}; choose another with "
                "--live-port, or 0 for any"
            ) from error
        self._clock_ns = 0
        self._shown_s = self._drawn_s = float("-inf")
        self._drawn: dict[int, int] = {}

    @property
    def address(self) -> str:
        """What a viewer connects to."""
        return f"ws://{HOST}:{self._server.port}"

    def __enter__(self) -> LiveView:
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()

    def wait(self, seconds: float) -> bool:
        """Wait for somebody to look; whether anybody does."""
        end = time.monotonic() + seconds
        while not self._joined.anybody and time.monotonic() < end:
            time.sleep(POLL_S)
        return self._joined.anybody

    def scan(self, scan: Scan, slam: Slam) -> None:
        """Show a scan and, now and then, the curves and the path."""
        # stamps may step back; a viewer whose clock does forgets what it was shown
        self._clock_ns = min(max(self._clock_ns, scan.stamp_ns), LATEST_NS)
        now_s = time.monotonic()
        if not self._joined.anybody or now_s - self._shown_s < SCANS_EVERY_S:
            return
        view = slam.view()
        if view is None:
            return
        self._shown_s = now_s
        new_viewer = self._joined.take()
        frames = [(_frame(k), pose) for k, pose in enumerate(view.poses_map_submap)]
        self._server.broadcast_time(self._clock_ns)
        poses = [*frames, (self._make.BASE_FRAME, view.pose_map_base)]
        self._send("tf", self._make.transforms(poses, self._clock_ns))
        self._send("scan", self._make.laser_scan(scan, self._clock_ns))
        if new_viewer or now_s - self._drawn_s >= CURVES_EVERY_S:
            self._drawn_s = now_s
            if new_viewer:
                self._drawn.clear()
            self._show_curves(view, slam.settings.merging.max_weight)
            every = -(-len(view.keyframes) // LONGEST_PATH)
            self._send("path", self._make.path(view.path()[::-every][::-1], self._clock_ns))

    def finished(self, document: MapDocument, trajectory: Trajectory) -> None:
        """Show the finished map instead of its parts, and see it off."""
        stamp_ns, make = self._clock_ns, self._make
        entities = [
            make.curves(
                f"curves {level.knot_step_m:g}",
                make.MAP_FRAME,
                level,
                document.max_weight,
                stamp_ns,
            )
            for level in document.chosen_levels()
        ]
        every = -(-len(trajectory) // LONGEST_PATH) or 1
        poses = [SE2.from_array(pose) for pose in trajectory.poses[::-every][::-1]]
        self._server.broadcast_time(stamp_ns)
        self._send("tf", make.transforms([(make.BASE_FRAME, poses[-1])], stamp_ns))
        self._send("path", make.path(poses, stamp_ns))
        self._send("curves", make.scene(entities, instead_of_all=True, stamp_ns=stamp_ns))
        if self._joined.anybody:
            time.sleep(DELIVERY_S)

    def _show_curves(self, view: SlamView, max_weight: int) -> None:
        """The submaps that have changed."""
        changed = []
        for submap in view.submaps:
            if self._drawn.get(submap.index) == len(submap.keyframes):
                continue
            self._drawn[submap.index] = len(submap.keyframes)
            level = freeze_level(submap.levels[-1], max_weight=max_weight)
            submap.fold()
            name = _frame(submap.index)
            changed.append(self._make.curves(name, name, level, max_weight, self._clock_ns))
        if changed:
            self._send("curves", self._make.scene(changed, stamp_ns=self._clock_ns))

    def _send(self, channel: str, message: Any) -> None:
        getattr(self._channels, channel).log(message, log_time=self._clock_ns)


class _Channels:
    """What the server offers."""

    def __init__(self, context: Any) -> None:
        from foxglove.channels import (
            FrameTransformsChannel,
            LaserScanChannel,
            PosesInFrameChannel,
            SceneUpdateChannel,
        )

        self.tf = FrameTransformsChannel("/tf", context=context)
        self.scan = LaserScanChannel("/scan", context=context)
        self.path = PosesInFrameChannel("/map/path", context=context)
        self.curves = SceneUpdateChannel("/map/curves", context=context)


class _Joined:
    """Hears from a thread of the server who subscribes."""

    def __init__(self) -> None:
        self.anybody = False
        self._new = False

    def take(self) -> bool:
        """Whether there was anybody new since the last time."""
        new, self._new = self._new, False
        return new

    def on_subscribe(self, client: object, channel: object) -> None:
        self.anybody = self._new = True


def _frame(submap: int) -> str:
    return f"submap {submap}"
