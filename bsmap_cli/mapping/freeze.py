"""From the growing map to the finished one: only what data support, in the order of the file."""

from __future__ import annotations

import numpy as np

from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.fitting import lattice_domain
from bsmap_cli.mapping.map_document import TENTATIVE, MapLevel


def freeze_level(curve_map: CurveMap, *, max_weight: int, min_seen: int = 1) -> MapLevel:
    """The curves of one knot step as a `MapLevel`; rarely seen ones (`min_seen`) tentative."""
    arrays, degree, step = curve_map.arrays, curve_map.degree, curve_map.knot_step_m
    columns: dict[str, list[float]] = {
        name: [] for name in ("id", "start", "end", "flags", "seen", "first", "count")
    }
    points, weights = [], []
    for curve in range(len(curve_map)):
        if arrays.count[curve] == 0:
            continue
        start, end = arrays.support[curve]
        low, last = lattice_domain(start, end)
        first = low - degree
        rows = slice(
            int(arrays.offset[curve] + first - arrays.first[curve]),
            int(arrays.offset[curve] + last - arrays.first[curve]),
        )
        points.append(arrays.points[rows])
        weights.append(arrays.weights[rows])
        columns["id"].append(curve)
        columns["start"].append((start - first) * step)
        columns["end"].append((end - first) * step)
        columns["flags"].append(TENTATIVE if arrays.seen[curve] < min_seen else 0)
        columns["seen"].append(min(int(arrays.seen[curve]), 65535))
        columns["first"].append(first)
        columns["count"].append(last - first)
    rounded = np.round(np.concatenate(weights)) if weights else np.zeros(0)
    return MapLevel(
        degree=degree,
        knot_step_m=step,
        curve_ids=np.array(columns["id"], np.uint32),
        tau_start_m=np.array(columns["start"], np.float32),
        tau_end_m=np.array(columns["end"], np.float32),
        flags=np.array(columns["flags"], np.uint16),
        observations=np.array(columns["seen"], np.uint16),
        first_indices=np.array(columns["first"], np.int32),
        point_counts=np.array(columns["count"], np.int64),
        control_points=np.concatenate([np.zeros((0, 2)), *points]).astype(np.float32),
        weights=np.clip(rounded, 1, max_weight).astype(np.uint8),
    )


def join_levels(parts: list[MapLevel]) -> MapLevel:
    """The curves of several levels of one knot step and one frame as one level, numbered anew."""
    joined = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in (
            "tau_start_m",
            "tau_end_m",
            "flags",
            "observations",
            "first_indices",
            "point_counts",
            "control_points",
            "weights",
        )
    }
    return MapLevel(
        degree=parts[0].degree,
        knot_step_m=parts[0].knot_step_m,
        curve_ids=np.arange(len(joined["flags"]), dtype=np.uint32),
        **joined,
    )
