"""Is there memory enough for what a large map takes? Told at once, not when it runs out."""

from __future__ import annotations

import os
from pathlib import Path

from bsmap_cli.errors import UsageError
from bsmap_cli.mapping.map_document import MapDocument

CONTROL_GROUP = Path("/sys/fs/cgroup/memory.max")
MOST = 0.5  # of the memory there is: other programs need theirs
SEARCHED_BYTES_EACH = 600.0  # for each control point of a map that scans are matched against


def refuse_too_large(document: MapDocument) -> None:
    """What `refuse_beyond_memory` tells of a map that scans are matched against."""
    points = sum(len(level.weights) for level in document.chosen_levels())
    refuse_beyond_memory(points, SEARCHED_BYTES_EACH, "finding scans on a map that has")


def refuse_beyond_memory(points: int, bytes_each: float, what: str) -> None:
    """What takes so many bytes for each control point of its maps.

    Raises
    ------
    UsageError : it would take more than half of the memory there is.
    """
    needed, there = points * bytes_each, memory_bytes()
    if there is not None and needed > MOST * there:
        raise UsageError(
            f"{what} {points} control points takes {needed / 1e9:.1f} GB of memory, more than half "
            f"of the {there / 1e9:.1f} GB there are: cut out what matters with "
            "`bsmap export MAP --clip X0,Y0,X1,Y1 -o part.bsm`"
        )


def memory_bytes() -> int | None:
    """What this process may hold: the machine's memory, or the part it was given; None: unknown."""
    try:
        most = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):  # not on Windows
        return None
    try:
        return min(most, int(CONTROL_GROUP.read_text()))
    except (ValueError, OSError):  # "max": all of it
        return most
