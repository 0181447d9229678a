"""What the arrays of a level must keep to be a map: the rules that `.bsm` files are held to."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.basis import MAX_DEGREE, MIN_DEGREE
from bsmap_cli.mapping.map_document import MapDocument, MapLevel

LARGEST_INDEX = 2**30
MOST_LEVELS = 255


@dataclass(frozen=True, slots=True)
class Fault:
    """A broken rule: in which row of which array, what was expected, what was found."""

    array: str
    row: int
    expected: str
    found: str


def find_fault(level: MapLevel, points: int) -> Fault | None:
    """The first broken rule, if any; the curves must add up to `points` control points."""
    return next(_faults(level, points), None)


def document_fault(document: MapDocument) -> str | None:
    """The first rule that a whole map breaks, in words; None where it is sound."""
    steps = [level.knot_step_m for level in document.levels]
    if not steps or len(steps) > MOST_LEVELS or sorted(set(steps), reverse=True) != steps:
        return f"expected 1 to {MOST_LEVELS} levels, coarse to fine, found knot steps {steps}"
    if not (np.isfinite(steps).all() and steps[-1] > 0.0):
        return f"expected knot steps above 0, found {steps}"
    if not MIN_DEGREE <= document.degree <= MAX_DEGREE:
        return f"expected a degree from {MIN_DEGREE} to {MAX_DEGREE}, found {document.degree}"
    for level in document.levels:
        if level.degree != document.degree:
            return f"expected levels of degree {document.degree}, found {level.degree}"
        fault = find_fault(level, len(level.weights))
        if fault is not None:
            return (
                f"expected {fault.expected}, found {fault.found}"
                f" (row {fault.row} of {fault.array}, knot step {level.knot_step_m} m)"
            )
    return None if np.isfinite(document.path).all() else "expected a finite path"


def rows_not_finite(array: NDArray[np.float32]) -> NDArray[np.int64]:
    """Rows of a (m, k) array that hold nan or infinity."""
    return np.flatnonzero(~np.isfinite(array).all(axis=1))


def _faults(level: MapLevel, points: int) -> Iterator[Fault]:
    least = 2 * level.degree + 2
    for row in map(int, np.flatnonzero(level.point_counts <= level.degree)):
        knots = level.point_counts[row] + level.degree + 1
        yield Fault("point_counts", row, f"{least} knots or more", str(knots))
    total = int(level.point_counts.sum())
    if total != points:
        expected = f"curves of {points} control points in all"
        yield Fault("point_counts", 0, expected, str(total))
    far = np.abs(level.first_indices.astype(np.int64)) >= LARGEST_INDEX
    for row in map(int, np.flatnonzero(far)):
        found = str(level.first_indices[row])
        yield Fault("first_indices", row, "a lattice index |I| below 2^30", found)
    for row in rows_not_finite(np.stack((level.tau_start_m, level.tau_end_m), axis=1)).tolist():
        found = f"{level.tau_start_m[row]} and {level.tau_end_m[row]}"
        yield Fault("taus", row, "finite tau_start and tau_end", found)
    for row in rows_not_finite(level.control_points):
        found = str(level.control_points[row].tolist())
        yield Fault("control_points", row, "a finite control point", found)
    _, firsts = np.unique(level.curve_ids, return_index=True)
    for row in np.setdiff1d(np.arange(len(level)), firsts):
        found = f"{level.curve_ids[row]} again"
        yield Fault("curve_ids", row, "curve ids unique within a level", found)
