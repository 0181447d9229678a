"""Scans as our own plain text form: a header row, then a scan a row."""

from __future__ import annotations

from collections.abc import Iterable
from typing import BinaryIO

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import canonical_yaw
from bsmap_cli.sensor.scan import Scan


def write_csv(stream: BinaryIO, scans: Iterable[Scan]) -> int:
    """Write the scans, in their order, to a stream that need not seek; the number written.

    The first scan decides the columns: odometry `x,y,theta`, `time_increment` and the laser's
    place `laser_x,laser_y,laser_theta` stand only where it has them. A scan with more beams than
    the header names has more cells in its row, one with fewer has fewer. Ranges have the nine
    digits that keep a float32, all else the digits that keep a float64.
    """
    columns: list[str] = []
    count = 0
    for scan in scans:
        if not columns:
            columns = _columns_of(scan)
            ranges = (f"r{i}" for i in range(len(scan.ranges_m)))
            stream.write((",".join((*columns, *ranges)) + "\n").encode())
        cells = _cells_of(scan)
        texts = [cells[name] for name in columns]
        texts.extend([f"{value:.9g}" for value in scan.ranges_m.tolist()])
        stream.write((",".join(texts) + "\n").encode())
        count += 1
    return count


def _columns_of(scan: Scan) -> list[str]:
    columns = ["stamp_ns"]
    if scan.pose_odom_base is not None:
        columns += ["x", "y", "theta"]
    columns += ["angle_min", "angle_increment", "range_min", "range_max"]
    if scan.time_increment_s != 0.0:
        columns += ["time_increment"]
    if scan.pose_base_laser != SE2.identity():
        columns += ["laser_x", "laser_y", "laser_theta"]
    return columns


def _cells_of(scan: Scan) -> dict[str, str]:
    laser = scan.pose_base_laser
    cells = {
        "stamp_ns": str(scan.stamp_ns),
        "angle_min": repr(scan.angle_min_rad),
        "angle_increment": repr(scan.angle_increment_rad),
        "range_min": repr(scan.range_min_m),
        "range_max": repr(scan.range_max_m),
        "time_increment": repr(scan.time_increment_s),
        "laser_x": repr(laser.x),
        "laser_y": repr(laser.y),
        "laser_theta": repr(canonical_yaw(laser.theta)),
    }
    odometry = scan.pose_odom_base
    if odometry is None:
        return cells | dict.fromkeys(("x", "y", "theta"), "")
    theta = canonical_yaw(odometry.theta)
    return cells | {"x": repr(odometry.x), "y": repr(odometry.y), "theta": repr(theta)}
