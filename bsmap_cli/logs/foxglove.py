"""What the JSON and the protobuf form of `foxglove.LaserScan` have in common."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.logs.canonical import float32_ranges
from bsmap_cli.logs.messages import BadMessageError, LaserRecord, plain_frame


def laser_record(
    *,
    stamp_ns: int,
    frame: str,
    start_rad: float,
    end_rad: float,
    ranges: NDArray[np.float64],
    pose: tuple[float, ...] | None,
) -> LaserRecord:
    """The record of beams from `start_rad` to `end_rad`, both included.

    pose : x, y, z [m] and quaternion x, y, z, w of the laser in `frame`; a quaternion of zeros is
        the default of the format and says nothing.
    """
    if len(ranges) < 2:
        raise BadMessageError("a scan without beams")
    if pose is not None and not any(pose[3:]):
        pose = (*pose[:3], 0.0, 0.0, 0.0, 1.0)
    return LaserRecord(
        stamp_ns,
        plain_frame(frame),
        start_rad,
        (end_rad - start_rad) / (len(ranges) - 1),
        0.0,
        0.0,
        math.inf,
        float32_ranges(ranges),
        pose,
    )
