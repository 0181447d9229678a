"""`bsmap export`: a map in the format of another program."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bsmap_cli.cli.door import DONE
from bsmap_cli.cli.formats import MAP_FORMATS, MapFormat, chosen_format
from bsmap_cli.cli.inputs import map_source, read_map_file, read_trajectory
from bsmap_cli.cli.options import Force, MapIn, TalkFlags, box, numbers, option
from bsmap_cli.cli.outputs import STDOUT, Output, Outputs
from bsmap_cli.cli.replay import ReplayFlags
from bsmap_cli.cli.talk import Talk
from bsmap_cli.errors import UsageError

if TYPE_CHECKING:
    from bsmap_cli.exchange.geodesy import GeoOrigin
    from bsmap_cli.exchange.selection import Selection
    from bsmap_cli.mapping.map_document import MapDocument

# which formats an option means something to
TAKERS: dict[str, tuple[MapFormat, ...]] = {
    "--level": ("svg", "png", "geojson", "dxf", "yaml", "csv", "ply", "mcap", "bsm"),
    "--clip": ("svg", "png", "geojson", "dxf", "yaml", "csv", "ply", "mcap", "bsm"),
    "--traj": ("svg", "png", "dxf", "yaml", "mcap"),
    "--resolution": ("png", "yaml"),
    "--simplify": ("geojson", "mcap"),
    "--origin": ("geojson",),
    "--compress": ("bsm",),
    "--log": ("mcap",),
}

EMPTY = "nothing is drawn: the map, or what --clip leaves of it, is empty"


@dataclass(frozen=True, slots=True, kw_only=True)
class PartFlags:
    """What of the map is exported, and how."""

    level: Annotated[
        float | None,
        option("--level", metavar="STEP", help="The level of this knot step [m]."),
    ] = None
    clip: Annotated[
        str | None,
        option("--clip", metavar="X0,Y0,X1,Y1", help="Only what lies in this box [m]."),
    ] = None
    traj: Annotated[
        str | None,
        option("--traj", metavar="FILE", help="This path, not the map's thinned one."),
    ] = None
    resolution: Annotated[
        float | None,
        option("--resolution", metavar="M", min=1e-4, help="Cells of yaml and png: 0.05 m."),
    ] = None
    simplify: Annotated[
        float | None,
        option("--simplify", metavar="M", min=0.0, help="How far lines may stray from curves."),
    ] = None
    origin: Annotated[
        str | None,
        option(
            "--origin",
            metavar="LAT,LON,HEADING",
            help="Where the map lies on Earth [degrees]; HEADING: of its x axis, from north.",
        ),
    ] = None
    compress: Annotated[
        bool, option("--compress", help="bsm: 3 bytes a control point, not 9 (rounds to 1 mm).")
    ] = False


def run(
    *,
    talk: TalkFlags,
    map_: MapIn = None,
    output: Annotated[
        str, option("--output", "-o", metavar="FILE", help="The file; `-`: standard output.")
    ],
    format_: Annotated[
        str | None,
        option("--format", metavar="NAME", help="The format, where the name does not tell."),
    ] = None,
    part: PartFlags,
    replay: ReplayFlags,
    force: Force = False,
) -> int:
    """Write a map in the format of another program.

    The extension of the output tells the format, or --format.

    \b
    Formats:
      svg      Bezier curves to scale, for browsers and Inkscape
      png      an image of occupied, free and unknown cells
      geojson  lines in metres, or on Earth with --origin, for GIS
      dxf      spline entities, for CAD
      yaml     a nav2 map: the .yaml and a .pgm beside it
      csv      control points
      json     all of the map; `bsmap` reads it back
      ply      samples with normals, for point cloud viewers
      mcap     line strips, path and grid, for Foxglove; with --log and --traj a replay
      bsm      the map file itself: one level of it, the curves that reach into a box,
               compressed, or back from json

    \b
    Example:
      bsmap export map.bsm -o map.svg
      bsmap export map.bsm -o map.yaml --resolution 0.1
      bsmap export map.bsm -o - --format geojson > map.geojson
    """
    voice = talk.talk()
    source = map_source(map_)
    kind = chosen_format(output, format_, MAP_FORMATS)
    _check_options(part, replay, kind)
    inputs = [path for path in (source, part.traj, replay.log) if path is not None]
    with Outputs(force=force, inputs=inputs) as outputs:
        target = outputs.add(output, binary=kind in ("png", "ply", "mcap", "bsm"))
        image = _image_beside(outputs, output) if kind == "yaml" else None
        document, _ = read_map_file(source)
        if kind == "bsm":
            _write_bsm(target, document, part, voice)
        elif kind == "json":
            from bsmap_cli.exchange.map_json import write_map_json

            write_map_json(target.open(), document)
        else:
            selection = _selection(document, part)
            if selection.is_empty and kind not in ("yaml", "png"):  # which refuse it
                voice.warn(EMPTY)
            if image is not None:
                _write_nav2(target, image, selection, part)
            elif kind == "mcap":
                return _write_mcap(target, selection, _tolerance_m(part), replay, voice)
            else:
                _write_selection(target, selection, kind, part)
    return DONE


def _check_options(part: PartFlags, replay: ReplayFlags, kind: MapFormat) -> None:
    given = {
        "--level": part.level,
        "--clip": part.clip,
        "--traj": part.traj,
        "--resolution": part.resolution,
        "--simplify": part.simplify,
        "--origin": part.origin,
        "--compress": part.compress or None,
        "--log": replay.log,
    }
    for name, value in given.items():
        if value is not None and kind not in TAKERS[name]:
            raise UsageError(
                f"{name} says nothing to {kind}: it goes with {', '.join(TAKERS[name])}"
            )
    replay.check(part.traj)


def _image_beside(outputs: Outputs, output: str) -> Output:
    if output == STDOUT:
        raise UsageError("a nav2 map is two files: name the .yaml")
    return outputs.add(str(Path(output).with_suffix(".pgm")))


def _selection(document: MapDocument, part: PartFlags) -> Selection:
    from bsmap_cli.exchange.selection import select

    trajectory = read_trajectory(part.traj) if part.traj is not None else None
    return select(document, level=part.level, clip=box(part.clip), trajectory=trajectory)


def _origin(text: str | None) -> GeoOrigin | None:
    from bsmap_cli.exchange.geodesy import GeoOrigin

    return None if text is None else GeoOrigin(*numbers("--origin", text, "48.137,11.575,30"))


def _write_bsm(target: Output, document: MapDocument, part: PartFlags, talk: Talk) -> None:
    from bsmap_cli.mapping.map_file import write_map

    if part.level is not None:
        document = replace(document, levels=document.chosen_levels(part.level), parts=False)
    if (clip := box(part.clip)) is not None:
        from bsmap_cli.exchange.selection import within_box

        document = within_box(document, clip)
        if not any(map(len, document.levels)):
            talk.warn(EMPTY)
    write_map(target.open(), document, compress=part.compress)


def _write_nav2(target: Output, image: Output, selection: Selection, part: PartFlags) -> None:
    from bsmap_cli.exchange.nav2 import (
        RESOLUTION_M,
        selected_occupancy,
        write_nav2_yaml,
        write_pgm,
    )

    grid = selected_occupancy(selection, resolution_m=part.resolution or RESOLUTION_M)
    write_pgm(image.open(), grid)
    write_nav2_yaml(target.open(), grid, Path(image.path).name)


def _tolerance_m(part: PartFlags) -> float:
    from bsmap_cli.exchange.flatten import TOLERANCE_M

    return TOLERANCE_M if part.simplify is None else part.simplify


def _write_selection(
    target: Output, selection: Selection, kind: MapFormat, part: PartFlags
) -> None:
    stream = target.open()
    if kind == "svg":
        from bsmap_cli.exchange.svg import write_svg

        write_svg(stream, selection)
    elif kind == "geojson":
        from bsmap_cli.exchange.geojson import write_geojson

        origin = _origin(part.origin)
        write_geojson(stream, selection, origin=origin, tolerance_m=_tolerance_m(part))
    elif kind == "dxf":
        from bsmap_cli.exchange.dxf import write_dxf

        write_dxf(stream, selection)
    elif kind == "csv":
        from bsmap_cli.exchange.control_points import write_control_points

        write_control_points(stream, selection)
    elif kind == "ply":
        from bsmap_cli.exchange.ply import write_ply

        write_ply(stream, selection)
    else:
        from bsmap_cli.evaluation.occupancy import trinary_png
        from bsmap_cli.exchange.nav2 import RESOLUTION_M, selected_occupancy

        grid = selected_occupancy(selection, resolution_m=part.resolution or RESOLUTION_M)
        stream.write(trinary_png(grid.cells))


def _write_mcap(
    target: Output, selection: Selection, tolerance_m: float, replay: ReplayFlags, talk: Talk
) -> int:
    from bsmap_cli.exchange.viewer_mcap import write_viewer_mcap

    with replay.scans(talk) as replayed:
        write_viewer_mcap(target.open(), selection, scans=replayed.scans, tolerance_m=tolerance_m)
    return replayed.code
