"""Maps as CSV: a row for each control point, all that is needed to evaluate the curves."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from bsmap_cli.exchange.selection import Selection

COLUMNS = (
    *("knot_step_m", "degree", "curve_id", "tau_start_m", "tau_end_m", "flags", "observations"),
    *("lattice_index", "x_m", "y_m", "weight"),
)


def write_control_points(stream: BinaryIO, selection: Selection) -> None:
    """Write all control points of the selected levels' curves, curve after curve.

    Control point g weighs the basis function with the knots g .. g + degree + 1 knot steps;
    tau_start and tau_end count from the knot of the curve's first lattice index. A clip leaves
    out whole curves only, those of which nothing lies within.
    """
    stream.write(f"{','.join(COLUMNS)}\n".encode())
    for selected in selection.levels:
        level = selected.level
        kept = np.ones(len(level), bool)
        if selection.clip is not None:
            kept[:] = False
            kept[selected.pieces.curve] = True
        rows = level.offsets()
        for curve in np.flatnonzero(kept).tolist():
            head = (
                f"{level.knot_step_m!r},{level.degree},{level.curve_ids[curve]},"
                f"{level.tau_start_m[curve]!s},{level.tau_end_m[curve]!s},"
                f"{level.flags[curve]},{level.observations[curve]}"
            )
            first, points = int(level.first_indices[curve]), range(rows[curve], rows[curve + 1])
            lines = [
                f"{head},{first + k},{level.control_points[row, 0]!s},"
                f"{level.control_points[row, 1]!s},{level.weights[row]}\n"
                for k, row in enumerate(points)
            ]
            stream.write("".join(lines).encode())
