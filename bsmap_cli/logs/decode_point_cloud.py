"""`sensor_msgs/PointCloud2`: x, y, z of its points, whatever else they carry."""

from __future__ import annotations

from typing import Any

import numpy as np

from bsmap_cli.logs.messages import BadMessageError, CloudRecord

_POINTS_LIMIT = 1 << 24
_FORMATS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}


def cloud_record(message: Any, stamp_ns: int, frame: str) -> CloudRecord:
    """Points without those that are not finite; raises BadMessageError where sizes disagree."""
    width, height = int(message.width), int(message.height)
    point_step, row_step = int(message.point_step), int(message.row_step)
    data = np.ascontiguousarray(message.data).view(np.uint8)
    if not 0 < width * height <= _POINTS_LIMIT:
        raise BadMessageError("a cloud without points")
    if height == 1 or row_step == 0:
        row_step = width * point_step
    if point_step <= 0 or row_step < width * point_step or height * row_step > len(data):
        raise BadMessageError("a cloud whose sizes disagree")
    points = _points_dtype(message, point_step)
    rows = data[: height * row_step].reshape(height, row_step)[:, : width * point_step]
    structured = np.ascontiguousarray(rows).reshape(-1).view(points)
    xyz = np.stack([structured[axis].astype(np.float64) for axis in "xyz"], axis=-1)
    xyz = xyz[np.isfinite(xyz).all(axis=1)]
    return CloudRecord(stamp_ns, frame, xyz, width if height > 1 else 0)


def _points_dtype(message: Any, point_step: int) -> np.dtype[np.void]:
    order = ">" if message.is_bigendian else "<"
    offsets: dict[str, int] = {}
    formats: dict[str, str] = {}
    for field in message.fields:
        if field.name in ("x", "y", "z") and field.datatype in _FORMATS:
            offsets[field.name] = int(field.offset)
            formats[field.name] = order + _FORMATS[field.datatype]
    if len(offsets) != 3:
        raise BadMessageError("a cloud without x, y and z")
    if any(offsets[axis] + int(formats[axis][2]) > point_step for axis in "xyz"):
        raise BadMessageError("a cloud whose fields lie outside of its points")
    return np.dtype(
        {
            "names": list("xyz"),
            "formats": [formats[axis] for axis in "xyz"],
            "offsets": [offsets[axis] for axis in "xyz"],
            "itemsize": point_step,
        }
    )
