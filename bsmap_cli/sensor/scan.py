"""One sweep of a planar lidar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import SE2

Ranges = NDArray[np.float32]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """Ranges in counter-clockwise order, as the log holds them, and where the laser sits.

    Beam i looks along `angle_min_rad + i * angle_increment_rad` in the laser's frame,
    `angle_increment_rad > 0`: readers flip clockwise lidars. Both angles are float32 values
    held in float64, so that one scan gives the same map from every container.

    stamp_ns : time of the first ray [ns].
    ranges_m : (n,) float32 [m], raw: NaN, infinities and codes for "no return" included.
    range_min_m, range_max_m : limits that the log states [m]; 0 and inf where it states none.
    time_increment_s : time from one beam to the next [s]; 0 where unknown, negative when the
        reader flipped a clockwise lidar.
    pose_base_laser : the laser in the base frame.
    pose_odom_base : odometry at `stamp_ns`, or None where the log has none.
    """

    stamp_ns: int
    ranges_m: Ranges
    angle_min_rad: float
    angle_increment_rad: float
    range_min_m: float = 0.0
    range_max_m: float = float("inf")
    time_increment_s: float = 0.0
    pose_base_laser: SE2 = SE2(0.0, 0.0, 0.0)  # noqa: RUF009 (frozen)
    pose_odom_base: SE2 | None = None
    topic: str = ""
