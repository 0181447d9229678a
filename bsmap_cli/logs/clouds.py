"""A horizontal slice of a point cloud as a planar scan: the nearest point in every direction."""

from __future__ import annotations

import math

import numpy as np

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import float32_ranges
from bsmap_cli.logs.messages import BadMessageError, CloudRecord, LaserRecord
from bsmap_cli.logs.transforms import Matrix, Mounting

_SLICE_M = 0.1
_FILLED = 0.9
_FEWEST_BEAMS, _MOST_BEAMS = 180, 4096


class CloudSlicer:
    """Turns the clouds of one topic into scans about the lidar, along the axes of the base.

    z_min_m, z_max_m : the slice, heights over the base; without either, 0.1 m below and above
        the lidar. The beam spacing comes from the first cloud and is kept: a little more than
        the spacing of its points, so that no direction stays empty between two of them.
    """

    def __init__(self, mounting: Mounting, z_min_m: float | None, z_max_m: float | None) -> None:
        matrix = np.eye(4) if mounting.matrix is None else mounting.matrix
        self._matrix: Matrix = matrix
        height_m = float(matrix[2, 3])
        if z_min_m is None and z_max_m is None:
            z_min_m, z_max_m = height_m - _SLICE_M, height_m + _SLICE_M
        self._low_m = -math.inf if z_min_m is None else z_min_m
        self._high_m = math.inf if z_max_m is None else z_max_m
        self._beams = 0
        self.pose_base_scan = SE2(float(matrix[0, 3]), float(matrix[1, 3]), 0.0)

    def slice(self, cloud: CloudRecord) -> LaserRecord:
        """The scan; empty directions are +inf. Raises BadMessageError for an empty first slice."""
        points_base = cloud.points @ self._matrix[:3, :3].T + self._matrix[:3, 3]
        height_m = points_base[:, 2]
        points_base = points_base[(height_m >= self._low_m) & (height_m <= self._high_m)]
        x_m = points_base[:, 0] - self.pose_base_scan.x
        y_m = points_base[:, 1] - self.pose_base_scan.y
        azimuth_rad = np.arctan2(y_m, x_m)
        if self._beams == 0:
            self._beams = _beams_of(azimuth_rad, cloud.columns)
        step_rad = math.tau / self._beams
        beam = np.floor((azimuth_rad + math.pi) / step_rad).astype(np.int64) % self._beams
        ranges = np.full(self._beams, np.inf)
        np.minimum.at(ranges, beam, np.hypot(x_m, y_m))
        return LaserRecord(
            cloud.stamp_ns,
            cloud.frame,
            -math.pi + step_rad / 2.0,
            step_rad,
            0.0,
            0.0,
            math.inf,
            float32_ranges(ranges),
        )


def _beams_of(azimuth_rad: np.ndarray[tuple[int], np.dtype[np.float64]], columns: int) -> int:
    if len(azimuth_rad) < 2:
        raise BadMessageError("a cloud without points between --z-min and --z-max")
    gaps_rad = np.diff(np.sort(azimuth_rad))
    gaps_rad = gaps_rad[gaps_rad > math.tau / _MOST_BEAMS]
    spacing_rad = float(np.median(gaps_rad)) if len(gaps_rad) else math.tau / _MOST_BEAMS
    if _FEWEST_BEAMS <= columns <= _MOST_BEAMS:
        spacing_rad = math.tau / columns
    return min(max(int(_FILLED * math.tau / spacing_rad), _FEWEST_BEAMS), _MOST_BEAMS)
