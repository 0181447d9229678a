"""What of a map is exported: levels, and the pieces of their curves within a box."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.mapping.map_document import MapDocument, MapLevel
from bsmap_cli.mapping.sampling import SLIVER, DrawnPieces, drawn_pieces, evaluate
from bsmap_cli.sensor.trajectory import Trajectory

Box = tuple[float, float, float, float]  # x0, y0, x1, y1 [m]

CLIP_STEP = 0.125  # [knot steps]: shorter dips into or out of the box are not seen
BISECTIONS = 40


@dataclass(frozen=True, slots=True)
class SelectedLevel:
    """A level and the pieces of its curves that are exported."""

    level: MapLevel
    pieces: DrawnPieces

    def portions(self) -> Iterator[SelectedLevel]:
        """The same, some curves at a time: see `MapLevel.portions`."""
        pieces = self.pieces
        for first, part in self.level.portions():
            begin, end = np.searchsorted(pieces.curve, (first, first + len(part))).tolist()
            if begin < end:
                curve = pieces.curve[begin:end] - first
                yield SelectedLevel(
                    part, DrawnPieces(curve, pieces.start[begin:end], pieces.end[begin:end])
                )

    def by_curve(self) -> Iterator[tuple[int, slice]]:
        """Each curve of which something is drawn, and which of the pieces are its."""
        curves, firsts = np.unique(self.pieces.curve, return_index=True)
        ends = [*firsts[1:].tolist(), len(self.pieces.curve)]
        for curve, begin, end in zip(curves.tolist(), firsts.tolist(), ends, strict=True):
            yield curve, slice(begin, end)


@dataclass(frozen=True, slots=True)
class Selection:
    """What the writers of this room write.

    path : (m, 3) float64 x, y [m], yaw [rad]: the trajectory, or the map's own thinned path.
    stamps_ns : (m,) int64 stamps of the trajectory; None where only the map's path is known.
    clip : the box that the pieces were cut to.
    """

    document: MapDocument
    levels: tuple[SelectedLevel, ...]
    path: NDArray[np.float64]
    stamps_ns: NDArray[np.int64] | None = None
    clip: Box | None = None

    @property
    def is_empty(self) -> bool:
        """Whether nothing is drawn."""
        return not any(len(level.pieces.curve) for level in self.levels)

    @property
    def frame(self) -> str:
        """The name of the map's frame."""
        return str(self.document.meta.get("frame", "map"))


def select(
    document: MapDocument,
    *,
    level: float | None = None,
    clip: Box | None = None,
    trajectory: Trajectory | None = None,
) -> Selection:
    """Choose the level of a knot step [m], else the finest or all parts; keep what is in the box.

    UsageError where the map has no such level.
    """
    levels = []
    for chosen in document.chosen_levels(level):
        pieces = drawn_pieces(chosen)
        levels.append(SelectedLevel(chosen, clipped(chosen, pieces, clip) if clip else pieces))
    path, stamps_ns = document.path.astype(np.float64), None
    if trajectory is not None:
        path, stamps_ns = trajectory.poses, trajectory.stamps_ns
    return Selection(document, tuple(levels), path, stamps_ns, clip)


def selected_document(selection: Selection) -> MapDocument:
    """The map of the selected levels; of clipped ones the whole curves that reach into the box."""
    levels = []
    for selected in selection.levels:
        kept = np.ones(len(selected.level), bool)
        if selection.clip is not None:
            kept[:] = False
            kept[selected.pieces.curve] = True
        levels.append(selected.level.only(kept))
    return replace(selection.document, levels=tuple(levels))


def within_box(document: MapDocument, box: Box) -> MapDocument:
    """The map of the whole curves that reach into the box, on each level."""
    levels = []
    for level in document.levels:
        kept = np.zeros(len(level), bool)
        kept[clipped(level, drawn_pieces(level), box).curve] = True
        levels.append(level.only(kept))
    return replace(document, levels=tuple(levels))


def clipped(level: MapLevel, pieces: DrawnPieces, box: Box) -> DrawnPieces:
    """The parts of the pieces that lie within the box, its border included."""
    inside, crossing = _places_of_curves(level, box)
    whole, parted = inside[pieces.curve], crossing[pieces.curve]
    within = DrawnPieces(pieces.curve[whole], pieces.start[whole], pieces.end[whole])
    cut = _cut(
        level, DrawnPieces(pieces.curve[parted], pieces.start[parted], pieces.end[parted]), box
    )
    curve = np.concatenate((within.curve, cut.curve))
    order = np.argsort(curve, kind="stable")
    return DrawnPieces(
        curve[order],
        np.concatenate((within.start, cut.start))[order],
        np.concatenate((within.end, cut.end))[order],
    )


def _places_of_curves(level: MapLevel, box: Box) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which curves lie within the box, and which may cross its border.

    A curve lies among its control points.
    """
    x0, y0, x1, y1 = box
    if not len(level):
        return np.zeros(0, bool), np.zeros(0, bool)
    first = level.offsets()[:-1]
    low = np.minimum.reduceat(level.control_points, first, axis=0)
    high = np.maximum.reduceat(level.control_points, first, axis=0)
    inside = np.all((low >= (x0, y0)) & (high <= (x1, y1)), axis=1)
    reached = np.all((high >= (x0, y0)) & (low <= (x1, y1)), axis=1)
    return np.asarray(inside), np.asarray(reached & ~inside)


def _cut(level: MapLevel, pieces: DrawnPieces, box: Box) -> DrawnPieces:
    """The same for pieces that may cross the border."""
    counts = np.maximum(np.ceil((pieces.end - pieces.start) / CLIP_STEP), 1).astype(np.int64) + 1
    piece = np.repeat(np.arange(len(counts)), counts)
    number = np.arange(len(piece)) - np.repeat(np.cumsum(counts) - counts, counts)
    share = number / (counts[piece] - 1)
    u = (1.0 - share) * pieces.start[piece] + share * pieces.end[piece]
    inside = _within(evaluate(level, pieces.curve[piece], u)[0], box)

    joined = piece[1:] == piece[:-1]
    enters = np.flatnonzero(joined & ~inside[:-1] & inside[1:])
    leaves = np.flatnonzero(joined & inside[:-1] & ~inside[1:])
    first = np.flatnonzero(inside & np.concatenate(([True], ~joined))[: len(inside)])
    last = np.flatnonzero(inside & np.concatenate((~joined, [True]))[: len(inside)])
    # both lists are in the order of the samples, and each start has its end
    start_rows, end_rows = np.concatenate((first, enters)), np.concatenate((last, leaves))
    starts = np.concatenate((u[first], _crossing(level, pieces.curve[piece], u, enters, box)))
    ends = np.concatenate((u[last], _crossing(level, pieces.curve[piece], u, leaves, box)))
    start_order, end_order = np.argsort(start_rows), np.argsort(end_rows)
    curve = pieces.curve[piece[start_rows[start_order]]]
    starts, ends = starts[start_order], ends[end_order]
    long = ends - starts > SLIVER
    return DrawnPieces(curve[long], starts[long], ends[long])


def _within(points: Points, box: Box) -> NDArray[np.bool_]:
    x0, y0, x1, y1 = box
    x, y = points[:, 0], points[:, 1]
    return np.asarray((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1))


def _crossing(
    level: MapLevel, curve: NDArray[np.int64], u: Vector, rows: NDArray[np.int64], box: Box
) -> Vector:
    """Where the curve crosses the border between each of the samples and the next."""
    outer_first = ~_within(evaluate(level, curve[rows], u[rows])[0], box)
    outside = np.where(outer_first, u[rows], u[rows + 1])
    inside = np.where(outer_first, u[rows + 1], u[rows])
    for _ in range(BISECTIONS):
        middle = 0.5 * (outside + inside)
        within = _within(evaluate(level, curve[rows], middle)[0], box)
        outside, inside = np.where(within, outside, middle), np.where(within, middle, inside)
    return inside
