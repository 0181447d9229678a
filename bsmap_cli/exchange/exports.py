"""Every format that a map is exported to in one file, by the name of the format."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import BinaryIO

from bsmap_cli.exchange.flatten import TOLERANCE_M
from bsmap_cli.exchange.geodesy import GeoOrigin
from bsmap_cli.exchange.selection import Selection, selected_document
from bsmap_cli.sensor.scan import Scan


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportOptions:
    """What only some formats ask for.

    tolerance_m : how far a polyline may stray from its curve (GeoJSON, MCAP). origin : where the
    map lies on Earth (GeoJSON). scans : placed along the path (MCAP).
    """

    tolerance_m: float = TOLERANCE_M
    origin: GeoOrigin | None = None
    scans: Iterable[Scan] = ()


def _svg(stream: BinaryIO, selection: Selection, options: ExportOptions) -> None:
    from bsmap_cli.exchange.svg import write_svg

    write_svg(stream, selection)


def _geojson(stream: BinaryIO, selection: Selection, options: ExportOptions) -> None:
    from bsmap_cli.exchange.geojson import write_geojson

    write_geojson(stream, selection, origin=options.origin, tolerance_m=options.tolerance_m)


def _dxf(stream: BinaryIO, selection: Selection, options: ExportOptions) -> None:
    from bsmap_cli.exchange.dxf import write_dxf

    write_dxf(stream, selection)


def _png(stream: BinaryIO, selection: Selection, options: ExportOptions) -> None:
    from bsmap_cli.plotting import plot_map, save_figure
    from bsmap_cli.sensor.trajectory import Trajectory

    trajectory = None
    if selection.stamps_ns is not None:
        trajectory = Trajectory(selection.stamps_ns, selection.path)
    document = selected_document(selection)
    colour_by = "weight" if len(document.levels) == 1 else "level"
    figure = plot_map(document, trajectory=trajectory, clip=selection.clip, colour_by=colour_by)
    save_figure(figure, stream, "png")


def _csv(stream: BinaryIO, selection: Selection, options: ExportOptions) -> None:
    from bsmap_cli.exchange.control_points import write_control_points

    write_control_points(stream, selection)


def _json(stream: BinaryIO, selection: Selection, options: ExportOptions) -> None:
    from bsmap_cli.exchange.map_json import write_map_json

    write_map_json(stream, selected_document(selection))


def _ply(stream: BinaryIO, selection: Selection, options: ExportOptions) -> None:
    from bsmap_cli.exchange.ply import write_ply

    write_ply(stream, selection)


def _mcap(stream: BinaryIO, selection: Selection, options: ExportOptions) -> None:
    from bsmap_cli.exchange.viewer_mcap import write_viewer_mcap

    write_viewer_mcap(stream, selection, scans=options.scans, tolerance_m=options.tolerance_m)


EXPORTERS: dict[str, Callable[[BinaryIO, Selection, ExportOptions], None]] = {
    "svg": _svg,
    "png": _png,
    "geojson": _geojson,
    "dxf": _dxf,
    "csv": _csv,
    "json": _json,
    "ply": _ply,
    "mcap": _mcap,
}
TEXT_FORMATS = ("svg", "geojson", "dxf", "csv", "json")
DEFAULT_OPTIONS = ExportOptions()


def export_map(
    stream: BinaryIO, selection: Selection, format_: str, options: ExportOptions = DEFAULT_OPTIONS
) -> None:
    """Write the selection in a format of `EXPORTERS`; the nav2 pair has its own module."""
    EXPORTERS[format_](stream, selection, options)
