"""Read a log in a second process, while this one works on the scans before."""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import fields
from itertools import islice
from multiprocessing.connection import Connection
from typing import TypeAlias

import numpy as np

from bsmap_cli.beside import Beside
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.reader import LogReader, ReadReport
from bsmap_cli.sensor.scan import Ranges, Scan

BATCH = 64  # scans in one message

_Fixed: TypeAlias = tuple[float, float, float, float, float, tuple[float, ...], str]
"""What the scans of a lidar have in common: angles [rad], limits [m], time [s], mounting, topic."""

_Moving: TypeAlias = tuple[int, int, int, "tuple[float, ...] | None"]
"""Stamp [ns], number of beams, which of the fixed parts, odometry."""


def scans_ahead(reader: LogReader) -> Iterator[Scan]:
    """The scans of a reader, and its report, as if they were read here.

    From a stream they are, as the next one may not be written yet; and where no second process is
    to be had.

    Raises
    ------
    LogError : as the reader does.
    """
    if reader.is_stream:
        return reader.scans()
    try:
        other = Beside(_read, reader)
    except OSError:
        return reader.scans()
    return _received(other, reader)


def _received(other: Beside, reader: LogReader) -> Iterator[Scan]:
    """The scans that the other process reads; where it comes to grief, the rest is read here."""
    at_first, count = deepcopy(reader.report), 0
    try:
        while True:
            try:
                moving, fixed, ranges_m, report = other.pipe.recv()
            except (OSError, EOFError):
                break
            _copy(report, reader.report)
            if not moving:
                return
            count += len(moving)
            yield from _unpacked(moving, fixed, ranges_m)
    finally:
        other.end()
    _copy(at_first, reader.report)
    yield from islice(reader.scans(), count, None)


def _copy(report: ReadReport, target: ReadReport) -> None:
    for entry in fields(ReadReport):
        setattr(target, entry.name, getattr(report, entry.name))


def _read(pipe: Connection, reader: LogReader) -> None:
    """Draw the scans and send them on; a message without any is the last."""
    scans = reader.scans()
    batch = None
    while batch != []:
        batch = list(islice(scans, BATCH))
        pipe.send((*_packed(batch), reader.report))


def _packed(scans: list[Scan]) -> tuple[list[_Moving], list[_Fixed], Ranges]:
    kinds: dict[_Fixed, int] = {}
    moving: list[_Moving] = []
    for scan in scans:
        fixed = (
            scan.angle_min_rad,
            scan.angle_increment_rad,
            scan.range_min_m,
            scan.range_max_m,
            scan.time_increment_s,
            tuple(scan.pose_base_laser),
            scan.topic,
        )
        odometry = None if scan.pose_odom_base is None else tuple(scan.pose_odom_base)
        kind = kinds.setdefault(fixed, len(kinds))
        moving.append((scan.stamp_ns, len(scan.ranges_m), kind, odometry))
    nothing = np.empty(0, np.float32)
    return moving, list(kinds), np.concatenate([nothing, *(scan.ranges_m for scan in scans)])


def _unpacked(moving: list[_Moving], fixed: list[_Fixed], ranges_m: Ranges) -> Iterator[Scan]:
    mounted = [SE2(*kind[5]) for kind in fixed]
    begin = 0
    for stamp_ns, beams, kind, odometry in moving:
        first_rad, step_rad, near_m, far_m, beam_s, _, topic = fixed[kind]
        yield Scan(
            stamp_ns=stamp_ns,
            ranges_m=ranges_m[begin : begin + beams],
            angle_min_rad=first_rad,
            angle_increment_rad=step_rad,
            range_min_m=near_m,
            range_max_m=far_m,
            time_increment_s=beam_s,
            pose_base_laser=mounted[kind],
            pose_odom_base=None if odometry is None else SE2(*odometry),
            topic=topic,
        )
        begin += beams
