"""Poses looked up by time: the pose of a trajectory at the stamp of a scan."""

from __future__ import annotations

import numpy as np

from bsmap_cli.geometry.se2 import SE2, wrap_angle
from bsmap_cli.sensor.trajectory import Trajectory

WIDEST_GAP_NS = 1_000_000_000  # poses farther apart are not interpolated
NEAR_NS = 20_000_000  # nearer than this one pose will do


class PoseTrack:
    """A trajectory, ordered by time, that answers for any stamp; `None` where it is silent."""

    def __init__(self, trajectory: Trajectory) -> None:
        order = np.argsort(trajectory.stamps_ns, kind="stable")
        self._stamps_ns = trajectory.stamps_ns[order]
        self._poses = trajectory.poses[order]

    def at(self, stamp_ns: int) -> SE2 | None:
        """The pose at `stamp_ns`: exact, else between its neighbours if these are at most a
        second apart, else the nearest within 20 ms, else None.
        """
        stamps_ns = self._stamps_ns
        after = int(np.searchsorted(stamps_ns, stamp_ns))
        if after < len(stamps_ns) and int(stamps_ns[after]) == stamp_ns:
            return SE2.from_array(self._poses[after])
        near = [row for row in (after - 1, after) if 0 <= row < len(stamps_ns)]
        if len(near) == 2:
            before_ns, after_ns = int(stamps_ns[after - 1]), int(stamps_ns[after])
            if after_ns - before_ns <= WIDEST_GAP_NS:
                share = (stamp_ns - before_ns) / (after_ns - before_ns)
                return _between(self._poses[after - 1], self._poses[after], share)
        distance_ns = [abs(int(stamps_ns[row]) - stamp_ns) for row in near]
        if not near or min(distance_ns) > NEAR_NS:
            return None
        return SE2.from_array(self._poses[near[distance_ns.index(min(distance_ns))]])


def _between(start: np.ndarray, end: np.ndarray, share: float) -> SE2:
    """Linear in x and y, and in the angle the short way round."""
    turn = wrap_angle(float(end[2] - start[2]))
    x, y = start[:2] + share * (end[:2] - start[:2])
    return SE2(float(x), float(y), wrap_angle(float(start[2]) + share * turn))
