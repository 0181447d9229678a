"""`bsmap plot`: a picture of a map and the path through it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from bsmap_cli.cli.formats import PICTURE_FORMATS, chosen_format
from bsmap_cli.cli.inputs import map_source, read_map_file, read_trajectory
from bsmap_cli.cli.options import Force, MapIn, TalkFlags, box, option
from bsmap_cli.cli.outputs import Outputs
from bsmap_cli.errors import UsageError


@dataclass(frozen=True, slots=True, kw_only=True)
class LookFlags:
    """What the picture shows."""

    level: Annotated[
        float | None,
        option("--level", metavar="STEP", help="Draw the level of this knot step [m]."),
    ] = None
    clip: Annotated[
        str | None,
        option("--clip", metavar="X0,Y0,X1,Y1", help="Show only this box [m]."),
    ] = None
    color_by: Annotated[
        Literal["weight", "curve", "level"] | None,
        option(
            "--color-by",
            metavar="weight|curve|level",
            help="What the color of a curve tells: its weight, by default.",
        ),
    ] = None
    width: Annotated[
        int | None,
        option("--width", metavar="PX", min=100, max=20000, help="Of a .png: 2000 pixels."),
    ] = None
    dark: Annotated[bool, option("--dark", help="Light on dark.")] = False
    control_points: Annotated[bool, option("--control-points", help="Mark the control points.")] = (
        False
    )
    knots: Annotated[bool, option("--knots", help="Mark the knots.")] = False


def run(
    *,
    talk: TalkFlags,
    map_: MapIn = None,
    output: Annotated[
        str,
        option(
            "--output", "-o", metavar="FILE", help="The picture: .png, .svg or .pdf; `-`: stdout."
        ),
    ],
    traj: Annotated[
        str | None,
        option("--traj", metavar="FILE", help="Draw this path (TUM), not the map's thinned one."),
    ] = None,
    reference: Annotated[
        str | None,
        option(
            "--reference",
            metavar="FILE",
            help="Color --traj by its distance from this true path (TUM).",
        ),
    ] = None,
    overlay: Annotated[
        str | None,
        option("--overlay", metavar="MAP", help="Draw a second map below, in another color."),
    ] = None,
    look: LookFlags,
    format_: Annotated[
        str | None,
        option("--format", metavar="png|svg|pdf", help="The format, where the name does not tell."),
    ] = None,
    force: Force = False,
) -> None:
    """Draw a map and the path through it, to scale.

    \b
    Example:
      bsmap plot map.bsm --traj map.tum -o map.png
      bsmap plot map.bsm --traj map.tum --reference truth.tum -o error.svg
      bsmap plot map.bsm --clip 0,0,4,3 --control-points --knots -o detail.pdf
    """
    if reference is not None and traj is None:
        raise UsageError("--reference compares with a path: give that with --traj")
    if overlay is not None and look.color_by is not None:
        raise UsageError("--color-by says nothing with --overlay: each map has one color then")
    clip = box(look.clip)
    source = map_source(map_)
    inputs = [path for path in (source, traj, reference, overlay) if path is not None]
    with Outputs(force=force, inputs=inputs) as outputs:
        kind = chosen_format(output, format_, PICTURE_FORMATS)
        if look.width is not None and kind != "png":
            raise UsageError(f"--width says nothing to {kind}, which has no pixels: leave it out")
        target = outputs.add(output, binary=kind != "svg")
        document, _ = read_map_file(source)

        from bsmap_cli.plotting import plot_map, save_figure

        figure = plot_map(
            document,
            trajectory=read_trajectory(traj) if traj is not None else None,
            reference=read_trajectory(reference) if reference is not None else None,
            overlay=read_map_file(overlay)[0] if overlay is not None else None,
            names=_names(source, overlay),
            level=look.level,
            clip=clip,
            colour_by=look.color_by or "weight",
            dark=look.dark,
            control_points=look.control_points,
            knots=look.knots,
        )
        save_figure(figure, target.open(), kind, width_px=look.width)


def _names(*sources: str | None) -> tuple[str, str]:
    """What the maps are called in the picture: as little as tells them apart."""
    given = [source or "" for source in sources]
    short = [Path(source).name for source in given]
    first, second = short if short[0] != short[1] else given
    return first, second
