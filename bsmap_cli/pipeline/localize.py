"""From a log and a saved map to a trajectory in the frame of the map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from bsmap_cli.beside import usable_cores
from bsmap_cli.config import Settings
from bsmap_cli.errors import TrackingError
from bsmap_cli.logs.reader import LogReader
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.pipeline.feed import Feed, Progress, Silent
from bsmap_cli.pipeline.memory_needed import refuse_too_large
from bsmap_cli.sensor.trajectory import Trajectory
from bsmap_cli.slam.localization import Localizer


@dataclass(frozen=True, slots=True, kw_only=True)
class Located:
    """Where the robot was: figures for the report; losses : one line each for what was lost."""

    trajectory: Trajectory
    figures: dict[str, Any]
    losses: tuple[str, ...]


def run_localize(
    reader: LogReader,
    document: MapDocument,
    settings: Settings,
    progress: Progress | None = None,
) -> Located:
    """Follow a robot through a saved map; where it starts is not known.

    Raises
    ------
    LogError : the log holds no usable scan.
    MapFileError : the map draws nothing.
    TrackingError : no place in the map fits the scans, or none is the only one that does.
    UsageError : there is not memory enough for a map so large.
    """
    refuse_too_large(document)
    localizer = Localizer(document, settings)
    feed = Feed(reader, progress or Silent(), usable_cores())
    for scan in feed:
        localizer.process(scan)
    found = localizer.finish()
    if found.converged_after_scans is None:
        raise TrackingError(
            f"the {feed.count} scans fit no place in the map, or more than one: "
            "is it a map of this place? A longer log may tell"
        )
    lost = found.lost_scans
    return Located(
        trajectory=found.trajectory,
        figures={
            "converged_after_scans": found.converged_after_scans,
            "scans": feed.count,
            "lost": lost,
        },
        losses=(f"{lost} scans have no place on the map; their poses are guesses",) if lost else (),
    )
