"""The growing map at one knot step, as plain arrays for compiled code."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class LevelArrays(NamedTuple):
    """Curves, their control points in rows, and the index of their spans.

    Each curve owns the rows `low` .. `high` and uses `count` of them from `offset`; the rest is
    room to grow at both ends. The span that starts at row r uses the rows r .. r + d. Arrays may
    be replaced by larger ones between calls, never inside one.

    sizes : curves, rows in use, cells in use, rows that the next run asks for.
    first : lattice index I; support : u_start, u_end [lattice units], what data support.
    seen : keyframes that met the curve.
    spans : middle x, y and half chord x, y [m] of each indexed span.
    """

    sizes: Integers
    first: Integers
    count: Integers  # type: ignore[assignment]
    offset: Integers
    low: Integers
    high: Integers
    seen: Integers
    support: Floats
    points: Floats
    weights: Floats
    owner: Integers
    spans: Floats
    next_span: Integers
    span_cell: Integers
    cell_keys: Integers
    cell_heads: Integers
