"""Maps as JSON: complete, readable, and read back without a change."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.errors import MapFileError
from bsmap_cli.mapping.level_rules import document_fault
from bsmap_cli.mapping.map_document import MapDocument, MapLevel

FORMAT, VERSION = "bsmap", 1


def write_map_json(stream: BinaryIO, document: MapDocument) -> None:
    """Write the document of `document_to_json`, a line for each curve."""
    head = document_to_json(replace(document, levels=()))
    del head["levels"]
    stream.write(f'{_dump(head)[:-1]},"levels":[\n'.encode())
    for number, level in enumerate(document.levels):
        comma = ",\n" if number else ""
        stream.write(f'{comma}{{"knot_step_m":{level.knot_step_m!r},"curves":[\n'.encode())
        for first, part in level.portions():
            curves = ",\n".join(_dump(curve) for curve in _curves(part))
            stream.write(((",\n" if first else "") + curves).encode())
        stream.write(b"]}")
    stream.write(b"]}\n")


def read_map_json(stream: BinaryIO) -> MapDocument:
    """Read what `write_map_json` wrote; MapFileError where it is something else."""
    try:
        document = json.loads(stream.read())
    except (ValueError, RecursionError) as error:
        raise MapFileError(f"not a map in JSON: {error}") from error
    return document_from_json(document)


def document_to_json(document: MapDocument) -> dict[str, Any]:
    """All of the map as JSON values; float32 numbers in the fewest digits that give them back."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "degree": document.degree,
        "max_weight": document.max_weight,
        "parts": document.parts,
        "meta": document.meta,
        "path": _short(document.path),
        "levels": [
            {"knot_step_m": level.knot_step_m, "curves": _curves(level)}
            for level in document.levels
        ],
    }


def document_from_json(document: Any) -> MapDocument:
    """The map of `document_to_json`; MapFileError says what is missing or impossible."""
    try:
        if document["format"] != FORMAT or document["version"] != VERSION:
            raise MapFileError(
                f"expected a {FORMAT} map of version {VERSION} in JSON, found"
                f" {document['format']} of version {document['version']}"
            )
        degree = int(document["degree"])
        levels = tuple(_level(level, degree) for level in document["levels"])
        path = np.array(document["path"], np.float32).reshape(-1, 3)
        found = MapDocument(
            degree=degree,
            max_weight=int(document["max_weight"]),
            levels=levels,
            meta=dict(document["meta"]),
            path=path,
            parts=bool(document["parts"]),
        )
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise MapFileError(f"not a map in JSON: {error!r}") from error
    fault = document_fault(found)
    if fault is not None:
        raise MapFileError(f"the map in JSON is damaged: {fault}")
    return found


def _dump(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def _short(array: NDArray[np.float32]) -> Any:
    return array.astype(np.str_).astype(np.float64).tolist() if array.size else array.tolist()


def _curves(level: MapLevel) -> list[dict[str, Any]]:
    rows = level.offsets().tolist()
    points, weights = _short(level.control_points), level.weights.tolist()
    columns = zip(
        level.curve_ids.tolist(),
        level.flags.tolist(),
        level.observations.tolist(),
        _short(level.tau_start_m),
        _short(level.tau_end_m),
        level.first_indices.tolist(),
        strict=True,
    )
    return [
        {
            "curve_id": curve_id,
            "flags": flags,
            "observations": observations,
            "tau_start_m": start,
            "tau_end_m": end,
            "first_index": first,
            "control_points": points[rows[k] : rows[k + 1]],
            "weights": weights[rows[k] : rows[k + 1]],
        }
        for k, (curve_id, flags, observations, start, end, first) in enumerate(columns)
    ]


def _level(level: dict[str, Any], degree: int) -> MapLevel:
    curves = level["curves"]

    def column(name: str, kind: type) -> NDArray[Any]:
        return np.array([curve[name] for curve in curves], kind)

    counts = [len(curve["control_points"]) for curve in curves]
    if counts != [len(curve["weights"]) for curve in curves]:
        raise ValueError("a curve has not as many weights as control points")
    points = [point for curve in curves for point in curve["control_points"]]
    weights = [weight for curve in curves for weight in curve["weights"]]
    return MapLevel(
        degree=degree,
        knot_step_m=float(level["knot_step_m"]),
        curve_ids=column("curve_id", np.uint32),
        tau_start_m=column("tau_start_m", np.float32),
        tau_end_m=column("tau_end_m", np.float32),
        flags=column("flags", np.uint16),
        observations=column("observations", np.uint16),
        first_indices=column("first_index", np.int32),
        point_counts=np.array(counts, np.int64),
        control_points=np.array(points, np.float32).reshape(-1, 2),
        weights=np.array(weights, np.uint8),
    )
