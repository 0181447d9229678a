"""Maps as CSV: a row for each control point, all that is needed to evaluate the curves."""

from __future__ import annotations

from typing import BinaryIO

from bsmap_cli.exchange.selection import Selection, selected_document

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
    for level in selected_document(selection).levels:
        rows = level.offsets()
        for curve in range(len(level)):
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
