"""What a map holds and what it costs, beside a grid of the same place."""

from __future__ import annotations

import io
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.evaluation.occupancy import MOST_CELLS, grid_frame, occupancy, trinary_png
from bsmap_cli.evaluation.redundancy import SAMPLES_PER_STEP, redundancy
from bsmap_cli.geometry.se2 import Points
from bsmap_cli.mapping.map_document import LevelSamples, MapDocument, MapLevel
from bsmap_cli.mapping.map_file import MapSizes, write_map
from bsmap_cli.mapping.sampling import drawn_pieces, evaluate, sample_places

GRID_M = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelStatistics:
    """One knot step [m]: curves, control points, bytes of arrays, drawn length [m]."""

    knot_step: float
    curves: int
    control_points: int
    bytes: int
    length_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MapStatistics:
    """The keys of `stats --json`; figures not of the file are those of the finest level.

    bytes_per_control_point : bytes of points and weights; of all arrays where they are compressed
        into one block. None stands where there is nothing to divide by, or no room for the grid.
    """

    file_bytes: int
    payload_bytes: int
    path_bytes: int
    curves: int
    control_points: int
    bytes_per_control_point: float | None
    degree: int
    length_m: float
    bounds_m: tuple[float, float, float, float] | None
    redundancy: float
    levels: tuple[LevelStatistics, ...]
    grid_5cm_bytes: int
    ratio_to_grid_5cm: float | None
    grid_5cm_png_bytes: int | None
    ratio_to_png: float | None

    def as_json(self) -> dict[str, Any]:
        """The statistics as JSON values."""
        return asdict(self)


def sizes_of(document: MapDocument, *, compress: bool = False) -> MapSizes:
    """The sizes that a file of the document has."""
    return write_map(io.BytesIO(), document, compress=compress)


def map_statistics(document: MapDocument, sizes: MapSizes) -> MapStatistics:
    """Count and measure; `sizes` are those of the file, see `read_map_with_sizes`."""
    drawn = [_drawn(level) for level in document.levels]
    levels = tuple(
        LevelStatistics(
            knot_step=level.knot_step_m,
            curves=len(level),
            control_points=len(level.weights),
            bytes=level_bytes,
            length_m=length_m,
        )
        for level, level_bytes, (length_m, _) in zip(
            document.levels, sizes.level_bytes, drawn, strict=True
        )
    )
    finest, corners = levels[-1], drawn[-1][1]
    raw = finest.bytes == 24 * finest.curves + 9 * finest.control_points
    point_bytes = 9 * finest.control_points if raw else finest.bytes
    grid = grid_frame(corners, GRID_M).cells
    png = _png_bytes(document) if 0 < grid <= MOST_CELLS else None
    return MapStatistics(
        file_bytes=sizes.file_bytes,
        payload_bytes=finest.bytes,
        path_bytes=sizes.path_bytes,
        curves=finest.curves,
        control_points=finest.control_points,
        bytes_per_control_point=_ratio(point_bytes, finest.control_points),
        degree=document.degree,
        length_m=finest.length_m,
        bounds_m=_bounds(corners),
        redundancy=redundancy(document.finest),
        levels=levels,
        grid_5cm_bytes=grid,
        ratio_to_grid_5cm=_ratio(grid, finest.bytes),
        grid_5cm_png_bytes=png,
        ratio_to_png=_ratio(png or 0, finest.bytes),
    )


def drawn_length(samples: LevelSamples) -> float:
    """Length of the drawn curves [m], as chords between the samples."""
    return _length(samples.points, samples.piece)


def _length(points: Points, piece: NDArray[np.int64]) -> float:
    chords = np.diff(points, axis=0)[np.diff(piece) == 0]
    return float(np.hypot(chords[:, 0], chords[:, 1]).sum())


def _png_bytes(document: MapDocument) -> int:
    path = document.path[:, :2].astype(np.float64)
    grid = occupancy([document.finest], path, resolution_m=GRID_M)
    return len(trinary_png(grid.cells))


def _drawn(level: MapLevel) -> tuple[float, Points]:
    """Length of what is drawn [m], and points that have its bounding box."""
    length_m, corners = 0.0, [np.zeros((0, 2))]
    for _, part in level.portions():
        pieces = drawn_pieces(part)
        piece, u = sample_places(part, pieces, level.knot_step_m / SAMPLES_PER_STEP)
        points, _ = evaluate(part, pieces.curve[piece], u)
        if len(points):
            length_m += _length(points, piece)
            corners += [points.min(axis=0)[None], points.max(axis=0)[None]]
    return length_m, np.concatenate(corners)


def _bounds(corners: Points) -> tuple[float, float, float, float] | None:
    if not len(corners):
        return None
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)


def _ratio(amount: int, of: int) -> float | None:
    return amount / of if amount and of else None
