"""Maps as PLY: samples of the curves with their normals, for viewers of point clouds."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.exchange.selection import SelectedLevel, Selection
from bsmap_cli.mapping.sampling import sample_counts, sample_pieces

SAMPLES_PER_STEP = 4
FIELDS = (
    *((name, "<f8", "double") for name in ("x", "y", "z")),
    *((name, "<f4", "float") for name in ("nx", "ny", "nz", "weight")),
    ("curve_id", "<u4", "uint"),
)
VERTEX = np.dtype([(name, kind) for name, kind, _ in FIELDS])


def write_ply(stream: BinaryIO, selection: Selection) -> None:
    """Write binary vertices, a quarter of a knot step apart, in metres of the map's frame.

    Normals point to the free side; z is 0.
    """
    steps = [selected.level.knot_step_m / SAMPLES_PER_STEP for selected in selection.levels]
    count = sum(
        int(sample_counts(selected.level, selected.pieces, step_m).sum())
        for selected, step_m in zip(selection.levels, steps, strict=True)
    )
    properties = "".join(f"property {kind} {name}\n" for name, _, kind in FIELDS)
    stream.write(
        "ply\nformat binary_little_endian 1.0\ncomment metres of the map's frame\n"
        f"element vertex {count}\n{properties}end_header\n".encode("ascii")
    )
    for selected, step_m in zip(selection.levels, steps, strict=True):
        for part in selected.portions():
            stream.write(_vertices(part, step_m).tobytes())


def _vertices(selected: SelectedLevel, step_m: float) -> NDArray[np.void]:
    samples = sample_pieces(selected.level, selected.pieces, step_m)
    vertices = np.zeros(len(samples.points), VERTEX)
    vertices["x"], vertices["y"] = samples.points.T
    vertices["nx"], vertices["ny"] = -samples.tangents[:, 1], samples.tangents[:, 0]
    vertices["weight"] = samples.weight
    vertices["curve_id"] = selected.level.curve_ids[samples.curve]
    return vertices
