"""Scans as our own plain text form: a header row, then a scan a row."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import chain, islice
from typing import BinaryIO

from bsmap_cli.errors import LogError
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.canonical import canonical_yaw
from bsmap_cli.sensor.scan import Scan

_JUDGED_SCANS = 200


def write_csv(stream: BinaryIO, scans: Iterable[Scan]) -> int:
    """Write the scans, in their order, to a stream that need not seek; the number written.

    The first 200 scans decide the columns: odometry `x,y,theta`, `time_increment` and the laser's
    place `laser_x,laser_y,laser_theta` stand only where one of them has it. A scan with more
    beams than the header names has more cells in its row, one with fewer has fewer. Ranges have
    the nine digits that keep a float32, all else the digits that keep a float64.

    Raises LogError for a later scan with something that has no column.
    """
    source = iter(scans)
    judged = list(islice(source, _JUDGED_SCANS))
    if not judged:
        return 0
    columns = _columns_of(judged)
    ranges = (f"r{i}" for i in range(max(len(scan.ranges_m) for scan in judged)))
    stream.write((",".join((*columns, *ranges)) + "\n").encode())
    count = 0
    for scan in chain(judged, source):
        if not set(_columns_of([scan])).issubset(columns):
            raise LogError(
                f"scan {count} has odometry, a place or a time increment that the first"
                f" {_JUDGED_SCANS} scans have not: write mcap"
            )
        cells = _cells_of(scan)
        texts = [cells[name] for name in columns]
        texts.extend([f"{value:.9g}" for value in scan.ranges_m.tolist()])
        stream.write((",".join(texts) + "\n").encode())
        count += 1
    return count


def _columns_of(scans: Sequence[Scan]) -> list[str]:
    columns = ["stamp_ns"]
    if any(scan.pose_odom_base is not None for scan in scans):
        columns += ["x", "y", "theta"]
    columns += ["angle_min", "angle_increment", "range_min", "range_max"]
    if any(scan.time_increment_s != 0.0 for scan in scans):
        columns += ["time_increment"]
    if any(scan.pose_base_laser != SE2.identity() for scan in scans):
        columns += ["laser_x", "laser_y", "laser_theta"]
    return columns


def _cells_of(scan: Scan) -> dict[str, str]:
    laser = scan.pose_base_laser
    numbers = {
        "angle_min": scan.angle_min_rad,
        "angle_increment": scan.angle_increment_rad,
        "range_min": scan.range_min_m,
        "range_max": scan.range_max_m,
        "time_increment": scan.time_increment_s,
        "laser_x": laser.x,
        "laser_y": laser.y,
        "laser_theta": canonical_yaw(laser.theta),
    }
    cells = dict.fromkeys(("x", "y", "theta"), "")
    odometry = scan.pose_odom_base
    if odometry is not None:
        numbers |= {"x": odometry.x, "y": odometry.y, "theta": canonical_yaw(odometry.theta)}
    cells |= {name: repr(float(number)) for name, number in numbers.items()}
    return cells | {"stamp_ns": str(scan.stamp_ns)}
