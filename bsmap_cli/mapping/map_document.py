"""A finished map as plain arrays: what is written, read, measured and exported."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.errors import UsageError
from bsmap_cli.geometry.curve import Curve
from bsmap_cli.geometry.se2 import SE2, Points, Vector

CLOSED = 1  # flag bit 0: the curve's end meets its start
TENTATIVE = 2  # flag bit 1: seen from too few viewpoints to be trusted
PORTION = 500_000  # control points that are worked on at once


@dataclass(frozen=True, slots=True, kw_only=True)
class MapLevel:
    """All curves of one knot step, curve after curve; frame: map.

    curve_ids : (K,) uint32, unique within the level.
    tau_start_m, tau_end_m : (K,) float32 [m], measured from knot lattice index I of the curve.
    flags, observations : (K,) uint16.
    first_indices : (K,) int32, I; point_counts : (K,) int64, N_i, adding up to N.
    control_points : (N, 2) float32 [m]; weights : (N,) uint8, 0 = never observed.
    """

    degree: int
    knot_step_m: float
    curve_ids: NDArray[np.uint32]
    tau_start_m: NDArray[np.float32]
    tau_end_m: NDArray[np.float32]
    flags: NDArray[np.uint16]
    observations: NDArray[np.uint16]
    first_indices: NDArray[np.int32]
    point_counts: NDArray[np.int64]
    control_points: NDArray[np.float32]
    weights: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.curve_ids)

    def offsets(self) -> NDArray[np.int64]:
        """(K + 1,) row of each curve's first control point."""
        return np.concatenate(([0], np.cumsum(self.point_counts)))

    def curve(self, index: int, offsets: NDArray[np.int64] | None = None) -> Curve:
        """Curve `index` with absolute tau; pass `offsets()` when asking for many."""
        rows = self.offsets() if offsets is None else offsets
        first, last = int(rows[index]), int(rows[index + 1])
        start_m = float(self.first_indices[index]) * self.knot_step_m
        return Curve(
            degree=self.degree,
            knot_step_m=self.knot_step_m,
            first_index=int(self.first_indices[index]),
            control_points=self.control_points[first:last].astype(np.float64),
            weights=self.weights[first:last].astype(np.float64),
            tau_start_m=start_m + float(self.tau_start_m[index]),
            tau_end_m=start_m + float(self.tau_end_m[index]),
        )

    def only(self, kept: NDArray[np.bool_]) -> MapLevel:
        """Without the curves that are not kept; kept : (K,)."""
        counts = self.point_counts[kept]
        # by number, not by a mask as long as the level: often a few are taken of many
        skipped = self.offsets()[:-1][kept] - (np.cumsum(counts) - counts)
        rows = np.repeat(skipped, counts) + np.arange(int(counts.sum()))
        return self._part(kept, rows)

    def _part(self, curves: NDArray[np.bool_] | slice, rows: NDArray[np.int64] | slice) -> MapLevel:
        return replace(
            self,
            curve_ids=self.curve_ids[curves],
            tau_start_m=self.tau_start_m[curves],
            tau_end_m=self.tau_end_m[curves],
            flags=self.flags[curves],
            observations=self.observations[curves],
            first_indices=self.first_indices[curves],
            point_counts=self.point_counts[curves],
            control_points=self.control_points[rows],
            weights=self.weights[rows],
        )

    def portions(self, most: int = PORTION) -> Iterator[tuple[int, MapLevel]]:
        """The curves in order, so many control points or one curve at a time; first curve of each.

        What goes over a large map in portions does not hold all that it makes of it at once.
        """
        ends = np.cumsum(self.point_counts)
        first = done = 0
        while first < len(self):
            last = max(first + 1, int(np.searchsorted(ends, done + most, side="right")))
            end = int(ends[last - 1])
            yield first, self._part(slice(first, last), slice(done, end))
            first, done = last, end

    def moved(self, pose_new_old: SE2) -> MapLevel:
        """The same curves in another frame."""
        points = pose_new_old.transform(self.control_points.astype(np.float64))
        return replace(self, control_points=points.astype(np.float32))

    def __iter__(self) -> Iterator[Curve]:
        rows = self.offsets()
        return (self.curve(index, rows) for index in range(len(self)))


@dataclass(frozen=True, slots=True, kw_only=True)
class MapDocument:
    """A map of one or more levels, coarse to fine, with what is known of its making.

    path : (M, 3) float32 x, y [m], yaw [rad]: thinned base poses in the map frame; may be empty.
    meta : what the META chunk holds (JSON values only).
    parts : the levels are parts of one map; otherwise each is a whole map.
    """

    degree: int
    max_weight: int
    levels: tuple[MapLevel, ...]
    meta: dict[str, Any] = field(default_factory=dict)
    path: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 3), np.float32))
    parts: bool = False

    @property
    def finest(self) -> MapLevel:
        """The level of the smallest knot step."""
        return self.levels[-1]

    def chosen_levels(self, knot_step_m: float | None = None) -> tuple[MapLevel, ...]:
        """The level of a knot step, or what makes up one whole map: the finest, or all parts.

        UsageError names the knot steps there are.
        """
        if knot_step_m is None:
            return self.levels if self.parts else self.levels[-1:]
        found = tuple(
            level for level in self.levels if abs(level.knot_step_m / knot_step_m - 1.0) < 1e-6
        )
        if not found:
            steps = ", ".join(f"{level.knot_step_m:g}" for level in self.levels)
            raise UsageError(f"the map has no level of knot step {knot_step_m:g} m: it has {steps}")
        return found


@dataclass(frozen=True, slots=True)
class LevelSamples:
    """Samples of the drawn parts of a level's curves, in curve order, ascending tau.

    points, tangents : (S, 2) float64, map frame; tangents have unit length, or are (0, 0) where
        a curve stands still.
    curve : (S,) int64 index into the level; tau_m : (S,) absolute [m]; weight : (S,) mean weight
    of the active control points. A drawn part ends where `curve` changes or `piece` does.
    """

    points: Points
    tangents: Points
    curve: NDArray[np.int64]
    piece: NDArray[np.int64]
    tau_m: Vector
    weight: Vector
