"""What a check of a log measures, scan by scan, in bounded memory."""

from __future__ import annotations

import heapq
import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.messages import SECOND_NS
from bsmap_cli.logs.steady_beams import SteadyBeams
from bsmap_cli.sensor.scan import Scan

_KEPT_INTERVALS = 1000
_SAMPLED_INTERVALS = 5000
_SAMPLED_SCANS = 1000
_BLIND_SHARE = 0.05
_UNSTATED_RANGE_M = 80.0
_NO_RETURN_SHARE = 0.995
_COMPARED_BEAMS = 90
_CLIPPED_M = 1.0
_WIDEST_TURN_RAD = math.radians(60.0)

Ranges = NDArray[np.float64]


class ScanStatistics:
    """Sums over the scans of one log; every topic is followed on its own.

    limit_m, limit_deg : steps between scans beyond one of them are counted in `far_steps`.
    """

    def __init__(self, limit_m: float, limit_deg: float) -> None:
        self._limit_m = limit_m
        self._limit_deg = limit_deg
        self.far_steps = 0
        self.count = 0
        self.beam_counts: set[int] = set()
        self.steps_back = 0
        self.farthest_back_s = 0.0
        self.repeated = 0
        self.blind = 0
        self.steady = SteadyBeams()
        self.longest_step_m = 0.0
        self.widest_turn_deg = 0.0
        self._first_ns: int | None = None
        self._before: dict[str, tuple[Scan, Ranges]] = {}
        self._longest: list[tuple[float, float]] = []
        self._intervals_s: list[float] = []
        self._usual_m: list[float] = []
        self._invalid = 0.0

    def add(self, scan: Scan) -> None:
        """Take the next scan of the log into account."""
        self.count += 1
        if self._first_ns is None:
            self._first_ns = scan.stamp_ns
        self.beam_counts.add(len(scan.ranges_m))
        ranges = _valid_ranges(scan)
        self.steady.add(scan, ranges)
        if len(self._usual_m) < _SAMPLED_SCANS:
            self._usual_m.append(_usual_range_m(scan))
        invalid = float(np.isnan(ranges).mean())
        self._invalid += invalid
        self.blind += invalid > 1.0 - _BLIND_SHARE
        before = self._before.get(scan.topic)
        self._before[scan.topic] = scan, ranges
        if before is not None:
            self._follow(before[0], before[1], scan, ranges)

    def usual_interval_s(self) -> float:
        """Median time between scans of one topic; 0 for a single scan."""
        return float(np.median(self._intervals_s)) if self._intervals_s else 0.0

    def longest_intervals(self) -> list[tuple[float, float]]:
        """Seconds after the first scan and length [s] of the longest intervals."""
        return [(at_s, interval_s) for interval_s, at_s in self._longest]

    def usual_range_m(self) -> float:
        """Median over the first scans of the range in the middle of each; 0 without returns."""
        return float(np.median(self._usual_m)) if self._usual_m else 0.0

    def invalid_share(self) -> float:
        """Mean share of beams without a return."""
        return self._invalid / max(self.count, 1)

    def _follow(self, before: Scan, ranges_before: Ranges, scan: Scan, ranges: Ranges) -> None:
        interval_ns = scan.stamp_ns - before.stamp_ns
        interval_s = interval_ns / SECOND_NS
        if interval_ns < 0:
            self.steps_back += 1
            self.farthest_back_s = max(self.farthest_back_s, -interval_s)
        elif interval_ns == 0:
            self.repeated += 1
        else:
            at_s = (before.stamp_ns - (self._first_ns or 0)) / SECOND_NS
            heapq.heappush(self._longest, (interval_s, at_s))
            if len(self._longest) > _KEPT_INTERVALS:
                heapq.heappop(self._longest)
            if len(self._intervals_s) < _SAMPLED_INTERVALS:
                self._intervals_s.append(interval_s)
        step_m, turn_deg = _step(before, ranges_before, scan, ranges)
        self.longest_step_m = max(self.longest_step_m, step_m)
        self.widest_turn_deg = max(self.widest_turn_deg, turn_deg)
        self.far_steps += step_m > self._limit_m or turn_deg > self._limit_deg


def _valid_ranges(scan: Scan) -> Ranges:
    """Ranges [m] with NaN for beams without a return."""
    ranges = scan.ranges_m.astype(np.float64)
    far_m = scan.range_max_m * _NO_RETURN_SHARE
    if not math.isfinite(far_m):
        far_m = _UNSTATED_RANGE_M
    ranges[~((ranges > 0.0) & (ranges >= scan.range_min_m) & (ranges <= far_m))] = np.nan
    return ranges


def _usual_range_m(scan: Scan) -> float:
    """The range in the middle of a scan, of all that are no code for "nothing there"; else 0."""
    ranges = scan.ranges_m
    with np.errstate(invalid="ignore"):
        seen = np.isfinite(ranges) & (ranges > 0.0) & (ranges < _NO_RETURN_SHARE * scan.range_max_m)
    return float(np.median(ranges[seen])) if seen.any() else 0.0


def _step(before: Scan, ranges_before: Ranges, scan: Scan, ranges: Ranges) -> tuple[float, float]:
    """Distance [m] and turn [degrees] of the base: by odometry, else the turn by the scans."""
    if before.pose_odom_base is not None and scan.pose_odom_base is not None:
        motion: SE2 = before.pose_odom_base.inverse() @ scan.pose_odom_base
        return math.hypot(motion.x, motion.y), abs(math.degrees(motion.theta))
    same_angles = (
        len(ranges) == len(ranges_before)
        and before.angle_min_rad == scan.angle_min_rad
        and before.angle_increment_rad == scan.angle_increment_rad
    )
    if not same_angles:
        return 0.0, 0.0
    return 0.0, math.degrees(_turn_rad(ranges_before, ranges, scan.angle_increment_rad))


def _turn_rad(before: Ranges, after: Ranges, step_rad: float) -> float:
    """The turn that makes two sweeps most alike, by shifting one against the other."""
    stride = max(1, len(after) // _COMPARED_BEAMS)
    before, after = before[::stride], after[::stride]
    reach = min(int(_WIDEST_TURN_RAD / (step_rad * stride)), len(after) // 2)
    edge = np.full(reach, np.nan)
    shifted = sliding_window_view(np.concatenate((edge, after, edge)), len(before))
    difference = np.minimum(np.abs(shifted - before), _CLIPPED_M)
    known = ~np.isnan(difference)
    overlap = known.sum(axis=1)
    sums = np.where(known, difference, 0.0).sum(axis=1)
    means = np.where(4 * overlap > len(after), sums / np.maximum(overlap, 1), np.inf)
    best = np.flatnonzero(means == means.min()) - reach
    return float(np.abs(best).min()) * step_rad * stride
