"""Odometry at the stamp of a scan, from a stream of poses beside the scans."""

from __future__ import annotations

from collections import deque
from itertools import islice
from typing import NamedTuple

from bsmap_cli.geometry.se2 import SE2, wrap_angle
from bsmap_cli.logs.canonical import canonical_pose
from bsmap_cli.logs.messages import SECOND_NS

NEAREST_NS = 1 * SECOND_NS
"""Beyond the ends of the stream the nearest pose stands in for no longer than this."""

_KEPT = 4096
_SEARCHED = 1024


class _Sample(NamedTuple):
    stamp_ns: int
    x_m: float
    y_m: float
    yaw_rad: float


class OdometryBuffer:
    """The latest poses `pose_odom_base`, in the order of the log.

    Stamps may repeat and step back: poses are never sorted, and only neighbours in the log whose
    stamps ascend are interpolated between.
    """

    def __init__(self) -> None:
        self._samples: deque[_Sample] = deque(maxlen=_KEPT)
        self._at: dict[int, _Sample] = {}
        self.pushed = 0

    def push(self, stamp_ns: int, x_m: float, y_m: float, yaw_rad: float) -> None:
        """Append a pose; the caller has seen to it that its numbers are finite."""
        if len(self._samples) == _KEPT:
            oldest = self._samples[0]
            if self._at.get(oldest.stamp_ns) is oldest:
                del self._at[oldest.stamp_ns]
        sample = _Sample(stamp_ns, x_m, y_m, yaw_rad)
        self._samples.append(sample)
        self._at[stamp_ns] = sample
        self.pushed += 1

    def at(self, stamp_ns: int) -> SE2 | None:
        """The pose that was measured at this very stamp (the last, of several), or None."""
        sample = self._at.get(stamp_ns)
        return None if sample is None else _pose(sample)

    def reaches(self, stamp_ns: int) -> bool:
        """Whether the newest pose is not older than the stamp."""
        return bool(self._samples) and self._samples[-1].stamp_ns >= stamp_ns

    def interpolated(self, stamp_ns: int) -> SE2 | None:
        """The pose at a stamp: measured, between neighbours, or nearest; None if all are far."""
        exact = self.at(stamp_ns)
        if exact is not None or not self._samples:
            return exact
        nearest = later = self._samples[-1]
        for sample in islice(reversed(self._samples), 1, _SEARCHED):
            if sample.stamp_ns <= stamp_ns <= later.stamp_ns:
                return _between(sample, later, stamp_ns)
            if abs(sample.stamp_ns - stamp_ns) < abs(nearest.stamp_ns - stamp_ns):
                nearest = sample
            later = sample
        return _pose(nearest) if abs(nearest.stamp_ns - stamp_ns) <= NEAREST_NS else None


def _between(earlier: _Sample, later: _Sample, stamp_ns: int) -> SE2:
    share = (stamp_ns - earlier.stamp_ns) / (later.stamp_ns - earlier.stamp_ns)
    turn = wrap_angle(later.yaw_rad - earlier.yaw_rad)
    return canonical_pose(
        earlier.x_m + share * (later.x_m - earlier.x_m),
        earlier.y_m + share * (later.y_m - earlier.y_m),
        earlier.yaw_rad + share * turn,
    )


def _pose(sample: _Sample) -> SE2:
    return canonical_pose(sample.x_m, sample.y_m, sample.yaw_rad)
