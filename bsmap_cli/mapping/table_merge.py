"""Merge a scan's curve into its map curve by the paper's Table I: Sec. III-D, eqs. (12)(13).

Both curves lie on one lattice, so the table is a union of dictionaries g -> control point. With I
and E = I + N the first lattice index of a curve and the one behind its last, 0-based,

    lo = max(I_m, I_k) + d        hi = min(E_m, E_k) - d

are u_1 and u_2 of the table: in [lo, hi) both are averaged, before and behind the curve that
reaches farther stands alone, the map where they tie. That drops the d end points of whichever
curve ends inside the other. I_new = min(I_m, I_k) and N_new = max(E_m, E_k) - I_new, eq. (13).
Printed wrong, and mended here (docs/paper.md, errata): the average divides by the weight before
the update, which throws the first observation away, and row 3 takes the weight at the wrong index.
"""

from __future__ import annotations

from bsmap_cli.geometry.compiled import lean_part
from bsmap_cli.geometry.se2 import Points
from bsmap_cli.mapping.level_arrays import LevelArrays


@lean_part
def merge_by_table(
    level: LevelArrays,
    curve: int,
    map_first: int,
    map_end: int,
    first: int,
    fitted: Points,
    degree: int,
    max_weight: float,
) -> None:
    """Write the control points of the new map curve; its rows must already span both.

    map_first, map_end : what the map curve held before; nothing (equal) initialises it, eq. (12).
    first, fitted : lattice index I_k and control points of the scan's curve.
    """
    end = first + len(fitted)
    offset = level.offset[curve] - level.first[curve]
    low = max(map_first, first) + degree
    high = min(map_end, end) - degree
    for i in range(len(fitted)):
        g = first + i
        row = offset + g
        if g < map_first or g >= map_end:
            taken = True
        elif low >= high:  # N_ws <= 0, of which the table says nothing: the map stands
            taken = False
        elif low <= g < high:  # row 2
            weight = min(max_weight, level.weights[row] + 1.0)
            level.points[row, 0] += (fitted[i, 0] - level.points[row, 0]) / weight
            level.points[row, 1] += (fitted[i, 1] - level.points[row, 1]) / weight
            level.weights[row] = weight
            taken = False
        elif g < low:  # row 1
            taken = first < map_first
        else:  # row 3
            taken = end > map_end
        if taken:
            level.points[row, 0], level.points[row, 1] = fitted[i, 0], fitted[i, 1]
            level.weights[row] = 1.0
