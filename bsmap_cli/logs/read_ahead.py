"""Read a log in a second process, while this one works on the scans before."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import fields
from itertools import islice
from multiprocessing.connection import Connection
from typing import TypeAlias

import numpy as np

from bsmap_cli.beside import CAN_FORK, Beside
from bsmap_cli.errors import LogError
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
    LogError : as the reader does; and where the other process was ended from outside.
    """
    other = None
    if CAN_FORK and not reader.is_stream:
        with suppress(OSError):
            other = Beside(_read, reader)
    if other is None:
        return reader.scans()
    return _received(other, reader.report)


def _received(other: Beside, report: ReadReport) -> Iterator[Scan]:
    try:
        while True:
            try:
                moving, fixed, ranges_m, read, failure = other.pipe.recv()
            except (OSError, EOFError):
                raise LogError("the process that reads the log was ended: try again") from None
            for entry in fields(ReadReport):
                setattr(report, entry.name, getattr(read, entry.name))
            yield from _unpacked(moving, fixed, ranges_m)
            if failure is not None:
                raise failure
            if not moving:
                return
    finally:
        other.end()


def _read(pipe: Connection, reader: LogReader) -> None:
    """Draw the scans and send them on; a message without any is the last."""
    failure: Exception | None = None
    scans = reader.scans()
    while True:
        batch: list[Scan] = []
        try:
            batch.extend(islice(scans, BATCH))
        except Exception as error:  # raised where the scans are wanted, behind those before it
            failure = error
        pipe.send((*_packed(batch), reader.report, failure))
        if not batch or failure:
            return


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
