"""Which format an output gets: said with --format, else known from its extension."""

from __future__ import annotations

from collections.abc import Collection, Mapping
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
PAGE_EXTENSIONS = (".html", ".htm")
# what the name of an output may promise
KNOWN_EXTENSIONS = {
    *(*LOG_FORMATS, *PICTURE_FORMATS, *MAP_FORMATS, *TRAJECTORY_FORMATS, *PAGE_EXTENSIONS),
    *(".tum", ".pgm", ".jpg", ".jpeg", ".gif", ".db3", ".clf"),
}


def refuse_extension(path: str, own: Collection[str], remedy: str) -> None:
    """Refuse an output whose name promises another format than the `own` extensions.

    Names without an extension, or with one that no program knows, are the user's business.

    Raises
    ------
    UsageError : with the remedy.
    """
    extension = Path(path).suffix.lower()
    if extension in KNOWN_EXTENSIONS and extension not in own:
        raise UsageError(f"{path}: {remedy}")


def refuse_no_map(path: str) -> None:
    """Refuse an output for a map whose name promises another format; see `refuse_extension`."""
    refuse_extension(
        path, (".bsm",), "a map is written as .bsm: name it so; `bsmap export` makes other formats"
    )


def refuse_no_trajectory(path: str | None) -> None:
    """Refuse an output for a trajectory, if one is wanted, whose name promises something else."""
    if path is None:
        return
    own = (".tum", *TRAJECTORY_FORMATS)
    refuse_extension(path, own, f"a trajectory is written as {', '.join(own)}: end the name so")


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
