"""Write scans as a log that other programs read."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import BinaryIO, Literal

from bsmap_cli.errors import UsageError
from bsmap_cli.exchange.atomic import temporary_beside
from bsmap_cli.exchange.bag_log import write_bag
from bsmap_cli.exchange.csv_log import write_csv
from bsmap_cli.exchange.mcap_log import write_mcap
from bsmap_cli.sensor.scan import Scan

LogFormat = Literal["mcap", "bag", "csv"]

_STREAM_WRITERS: dict[str, Callable[[BinaryIO, Iterable[Scan]], int]] = {
    "mcap": write_mcap,
    "csv": write_csv,
}


def write_log(target: str | Path | BinaryIO, scans: Iterable[Scan], format: LogFormat) -> int:
    """Write scans, in their order, with odometry and the laser's place where they carry them.

    target : a file, which appears only when it is whole and replaces an older one, or a binary
        stream that need not seek.
    format : "mcap" (ROS 2: `/scan`, `/odom`, `/tf_static`), "bag" (ROS 1, the same topics) or
        "csv". A scan whose topic begins with "/" goes to that topic instead of `/scan`.

    Returns the number of scans. Raises UsageError for another format, LogError for a stamp that
    the format cannot hold, OSError where the disk refuses.
    """
    if format not in ("mcap", "bag", "csv"):
        raise UsageError(f"no log can be written as {format!r}: choose mcap, bag or csv")
    if isinstance(target, str | Path):
        with temporary_beside(Path(target)) as path:
            return _write_file(path, scans, format)
    return _write_stream(target, scans, format)


def _write_file(path: Path, scans: Iterable[Scan], format: LogFormat) -> int:
    if format == "bag":
        return write_bag(path, scans)
    with path.open("wb") as stream:
        return _STREAM_WRITERS[format](stream, scans)


def _write_stream(stream: BinaryIO, scans: Iterable[Scan], format: LogFormat) -> int:
    if format != "bag":
        return _STREAM_WRITERS[format](stream, scans)
    with tempfile.TemporaryDirectory() as folder:  # a bag's first record names its last offset
        path = Path(folder) / "log.bag"
        count = write_bag(path, scans)
        with path.open("rb") as written:
            shutil.copyfileobj(written, stream)
    return count
