"""Maps for nav2: a `.pgm` of occupied, free and unknown cells and the `.yaml` that places it."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from bsmap_cli.errors import UsageError
from bsmap_cli.evaluation.occupancy import GridFrame, Occupancy, occupancy
from bsmap_cli.exchange.selection import Box, Selection

RESOLUTION_M = 0.05
OCCUPIED_THRESHOLD, FREE_THRESHOLD = 0.65, 0.196  # with 0.25 unknown pixels would load as free


def selected_occupancy(
    selection: Selection, *, resolution_m: float = RESOLUTION_M, range_max_m: float = 30.0
) -> Occupancy:
    """The grid of the selected levels, cut to the clip; free is what the path has seen.

    UsageError where the grid would be too large, or nothing is left of it.
    """
    levels = [selected.level for selected in selection.levels]
    path = selection.path[:, :2]
    grid = occupancy(levels, path, resolution_m=resolution_m, range_max_m=range_max_m)
    if selection.clip is not None:
        grid = _cropped(grid, selection.clip)
    if grid.cells.size == 0:
        raise UsageError("there is nothing to put into a grid: no curve is drawn there")
    return grid


def _cropped(grid: Occupancy, clip: Box) -> Occupancy:
    frame = grid.frame
    low, high = frame.in_cells(np.array([clip[:2], clip[2:]]))
    first = np.maximum(np.floor(low + 1e-9), 0).astype(int)
    last = np.minimum(np.ceil(high - 1e-9), [frame.columns, frame.rows]).astype(int)
    cells = grid.cells[first[1] : max(last[1], 0), first[0] : max(last[0], 0)]
    corner = np.array([frame.x_m, frame.y_m]) + first * frame.resolution_m
    rows, columns = cells.shape
    cropped = GridFrame(float(corner[0]), float(corner[1]), frame.resolution_m, rows, columns)
    return Occupancy(cropped, cells)


def write_pgm(stream: BinaryIO, grid: Occupancy) -> None:
    """Write the cells as a binary PGM: 0 occupied, 205 unknown, 254 free, highest row first."""
    rows, columns = grid.cells.shape
    stream.write(f"P5\n{columns} {rows}\n255\n".encode())
    stream.write(np.ascontiguousarray(grid.cells[::-1]).tobytes())


def write_nav2_yaml(stream: BinaryIO, grid: Occupancy, image: str) -> None:
    """Write what nav2's map server loads; `image` is the PGM's name relative to the YAML file.

    The origin is the lower left corner of the lower left cell, in full digits.
    """
    frame = grid.frame
    quoted = "'" + image.replace("'", "''") + "'"
    stream.write(
        f"image: {quoted}\n"
        "mode: trinary\n"
        f"resolution: {frame.resolution_m!r}\n"
        f"origin: [{frame.x_m!r}, {frame.y_m!r}, 0.0]\n"
        "negate: 0\n"
        f"occupied_thresh: {OCCUPIED_THRESHOLD}\n"
        f"free_thresh: {FREE_THRESHOLD}\n".encode()
    )
