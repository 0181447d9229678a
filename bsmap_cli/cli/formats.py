"""Which format an output gets: said with --format, else known from its extension."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal, TypeVar, get_args

from bsmap_cli.errors import UsageError

MapFormat = Literal["svg", "png", "geojson", "dxf", "yaml", "csv", "json", "ply", "mcap", "bsm"]
Kind = TypeVar("Kind", bound=str)

LOG_FORMATS: dict[str, Literal["mcap", "bag", "csv"]] = {
    ".mcap": "mcap",
    ".bag": "bag",
    ".csv": "csv",
}
PICTURE_FORMATS: dict[str, Literal["png", "svg", "pdf"]] = {
    ".png": "png",
    ".svg": "svg",
    ".pdf": "pdf",
}
MAP_FORMATS: dict[str, MapFormat] = {f".{kind}": kind for kind in get_args(MapFormat)}
TRAJECTORY_FORMATS = {".csv": "csv", ".json": "json", ".kitti": "kitti"}  # others are TUM


def chosen_format(path: str, said: str | None, by_extension: Mapping[str, Kind]) -> Kind:
    """The name of the format.

    Raises
    ------
    UsageError : neither --format nor the extension says one of `by_extension`.
    """
    known = ", ".join(dict.fromkeys(by_extension.values()))
    if said is not None:
        for kind in by_extension.values():
            if kind == said:
                return kind
        raise UsageError(f"no format {said!r}: choose one of {known}")
    if path == "-":
        raise UsageError(f"standard output has no extension: give --format ({known})")
    extension = Path(path).suffix.lower()
    if extension not in by_extension:
        ends = ", ".join(by_extension)
        raise UsageError(f"{path}: the extension names no format: end it in {ends}")
    return by_extension[extension]
