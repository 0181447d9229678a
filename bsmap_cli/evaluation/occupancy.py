"""A map as a grid of occupied, free and unknown cells; free space is what the path has seen."""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.errors import UsageError
from bsmap_cli.evaluation.visibility import bands, visible_cells
from bsmap_cli.geometry.se2 import Points
from bsmap_cli.mapping.map_document import LevelSamples, MapLevel
from bsmap_cli.mapping.sampling import DrawnPieces, drawn_pieces, evaluate, sample_pieces

Cells = NDArray[np.uint8]

OCCUPIED, UNKNOWN, FREE = 0, 205, 254
MARGIN_M = 0.5
MOST_CELLS = 2**27
ROOMY = 0.9  # of that: bends reach a little beyond the ends of curves
SAMPLES_AT_ONCE = 200_000


@dataclass(frozen=True, slots=True)
class GridFrame:
    """Where a grid lies: the lower left corner [m], the side of a cell [m], rows and columns.

    Row 0 is the lowest.
    """

    x_m: float
    y_m: float
    resolution_m: float
    rows: int
    columns: int

    @property
    def cells(self) -> int:
        """How many cells; one byte each in a plain grid."""
        return self.rows * self.columns

    def in_cells(self, points: Points) -> Points:
        """(m, 2) column and row of points of the map frame, with fractions."""
        corner: Points = np.array([self.x_m, self.y_m])
        return np.asarray((points - corner) / self.resolution_m)


@dataclass(frozen=True, slots=True)
class Occupancy:
    """cells : (rows, columns) uint8, one of OCCUPIED, UNKNOWN, FREE; row 0 is the lowest."""

    frame: GridFrame
    cells: Cells


def grid_frame(points: Points, resolution_m: float = 0.05) -> GridFrame:
    """The bounding box of the points, grown by half a metre."""
    if not len(points):
        return GridFrame(0.0, 0.0, resolution_m, 0, 0)
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    columns, rows = np.ceil((high - low) / resolution_m - 1e-9).astype(int)
    return GridFrame(float(low[0]), float(low[1]), resolution_m, int(rows), int(columns))


def occupancy(
    levels: Sequence[MapLevel],
    path: Points,
    *,
    resolution_m: float = 0.05,
    range_max_m: float = 30.0,
) -> Occupancy:
    """Rasterise the drawn curves and fill what is seen from the path.

    path : (m, 2) positions [m], map frame; a free cell lies between one of them and the free side
    of a curve within `range_max_m`. UsageError where the grid would not fit into memory.
    """
    least = grid_frame(_ends(levels), resolution_m)  # which costs nothing, and refuses most
    _refuse_large(least)
    corners = [np.zeros((0, 2))]
    for samples in _sampled(levels, resolution_m):
        corners += [samples.points.min(axis=0)[None], samples.points.max(axis=0)[None]]
    frame = grid_frame(np.concatenate(corners), resolution_m)
    _refuse_large(frame)
    cells = np.full((frame.rows, frame.columns), UNKNOWN, np.uint8)
    facing = np.zeros((frame.rows, frame.columns), np.uint8)
    for samples in _sampled(levels, resolution_m):
        _mark(facing, frame, samples)
    if len(path) and frame.cells:
        views = frame.in_cells(path)
        cells[visible_cells(facing, views, range_max_m / resolution_m)] = FREE
    cells[facing != 0] = OCCUPIED
    return Occupancy(frame, cells)


def fitting_resolution(levels: Sequence[MapLevel], resolution_m: float) -> float:
    """The given side of a cell [m], doubled as often as it takes for the grid to be allowed."""
    ends = _ends(levels)
    while grid_frame(ends, resolution_m).cells > ROOMY * MOST_CELLS:
        resolution_m *= 2.0
    return resolution_m


def _ends(levels: Sequence[MapLevel]) -> Points:
    """Where the drawn pieces of curves begin and end [m]: the grid is no smaller."""
    points = [np.zeros((0, 2))]
    for level in levels:
        pieces = drawn_pieces(level)
        points += [evaluate(level, pieces.curve, u)[0] for u in (pieces.start, pieces.end)]
    return np.concatenate(points)


def _refuse_large(frame: GridFrame) -> None:
    if frame.cells > MOST_CELLS:
        enough_m = frame.resolution_m * math.sqrt(frame.cells / MOST_CELLS)
        enough_m = math.ceil(20.0 * enough_m) / 20.0
        raise UsageError(
            f"a grid of {frame.columns} x {frame.rows} cells is too large: choose cells larger"
            f" than {frame.resolution_m:g} m, such as --resolution {enough_m:g}"
        )


def _sampled(levels: Sequence[MapLevel], resolution_m: float) -> Iterator[LevelSamples]:
    """Samples so close that no cell is missed, of some pieces at a time to spare memory."""
    for level in levels:
        pieces = drawn_pieces(level)
        per_step = 3.0 * level.knot_step_m / resolution_m
        ends = np.cumsum((pieces.end - pieces.start) * per_step)
        total = float(ends[-1]) if len(ends) else 0.0
        cuts = np.searchsorted(ends, np.arange(SAMPLES_AT_ONCE, total, SAMPLES_AT_ONCE)) + 1
        for rows in np.split(np.arange(len(ends)), cuts):
            if len(rows):
                some = DrawnPieces(pieces.curve[rows], pieces.start[rows], pieces.end[rows])
                yield sample_pieces(level, some, resolution_m / 3)


def trinary_png(cells: Cells) -> bytes:
    """The grid as a greyscale PNG of two bits a pixel, zlib level 9, first row highest.

    Shades are 0 occupied, 1 unknown, 3 free.
    """
    rows, columns = cells.shape
    packer = zlib.compressobj(9)
    data = b"".join(packer.compress(_png_lines(band)) for band in _from_above(cells))
    head = struct.pack(">IIBBBBB", columns, rows, 2, 0, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", data + packer.flush()), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


def _from_above(cells: Cells) -> Iterator[Cells]:
    return (cells[::-1][first:last] for first, last in bands(cells.shape))


def _png_lines(cells: Cells) -> bytes:
    """Rows of a PNG, four pixels a byte, first row first."""
    rows, columns = cells.shape
    shades = np.zeros((rows, -(-columns // 4) * 4), np.uint8)
    shades[:, :columns] = (cells == UNKNOWN) + np.uint8(3) * (cells == FREE)
    packed = shades.reshape(rows, -1, 4) @ np.array([64, 16, 4, 1], np.uint8)
    lines = np.zeros((rows, packed.shape[1] + 1), np.uint8)  # filter type 0 before each line
    lines[:, 1:] = packed
    return lines.tobytes()


def _mark(facing: Cells, frame: GridFrame, samples: LevelSamples) -> None:
    """Set, in each cell a curve passes, the octants of sight from which its free side is seen."""
    place = frame.in_cells(samples.points)
    limits = [frame.columns - 1, frame.rows - 1]
    column, row = np.clip(np.floor(place), 0, limits).astype(np.int64).T
    angle = (np.arange(8) + 0.5) * (np.pi / 4)
    # a sight line sees the free side, on the left, where it runs against the left normal
    across = np.outer(samples.tangents[:, 0], np.sin(angle)) - np.outer(
        samples.tangents[:, 1], np.cos(angle)
    )
    octants = np.packbits(across < np.sin(np.pi / 8), axis=1, bitorder="little")[:, 0]
    np.bitwise_or.at(facing, (row, column), octants)
    # where a curve steps diagonally one more cell keeps sight lines from slipping through
    step = np.flatnonzero((np.diff(row) != 0) & (np.diff(column) != 0))
    step = step[samples.piece[step] == samples.piece[step + 1]]
    np.bitwise_or.at(facing, (row[step], column[step + 1]), octants[step])
