"""`bsmap sim`: a made-up log with true poses and true surfaces."""

from __future__ import annotations

from typing import Annotated

import typer

from bsmap_cli.cli.formats import LOG_FORMATS, chosen_format
from bsmap_cli.cli.options import Force, TalkFlags, option
from bsmap_cli.cli.outputs import Outputs


def run(
    *,
    talk: TalkFlags,
    scene: Annotated[
        str,
        typer.Argument(
            metavar="SCENE", help="wall, spin, shapes, loop, corridor, twins; see below."
        ),
    ],
    output: Annotated[
        str,
        option("--output", "-o", metavar="FILE", help="The log: .mcap, .bag or .csv; `-`: stdout."),
    ],
    truth: Annotated[
        str | None,
        option("--truth", metavar="FILE", help="Also write the true poses (TUM)."),
    ] = None,
    surfaces: Annotated[
        str | None,
        option("--surfaces", metavar="FILE", help="Also write the true surfaces (GeoJSON)."),
    ] = None,
    lidar: Annotated[
        str, option("--lidar", metavar="ust10lx|lms200", help="The sensor that is imitated.")
    ] = "ust10lx",
    noise: Annotated[
        float | None,
        option("--noise", metavar="M", min=0.0, help="Range noise [m], instead of the lidar's."),
    ] = None,
    seed: Annotated[int, option("--seed", metavar="N", min=0, help="Of all that is random.")] = 0,
    no_odom: Annotated[bool, option("--no-odom", help="Leave odometry out of the log.")] = False,
    format_: Annotated[
        str | None,
        option(
            "--format", metavar="mcap|bag|csv", help="The format, where the name does not tell."
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Make up a log: a robot drives through a scene and measures.

    Walls and arcs are ray-cast exactly, then the ranges get the lidar's noise and the odometry
    gets a scale error and slip. The same seed gives the same bytes.

    \b
    Scenes:
      wall      follow a wall, translating (the paper's first mission)
      spin      360 degrees on the spot (the paper's second)
      shapes    different geometric shapes in one room
      loop      a ring of corridors with doors and pillars, twice round
      corridor  bare parallel walls
      twins     two identical rooms joined by a corridor

    \b
    Example:
      bsmap sim wall -o wall.mcap --truth wall.tum --surfaces wall.geojson
    """
    from io import StringIO

    from bsmap_cli.exchange.log_writers import write_log
    from bsmap_cli.exchange.surfaces import surfaces_geojson
    from bsmap_cli.exchange.tum import write_tum
    from bsmap_cli.sensor.simulator.simulation import simulate

    with Outputs(force=force) as outputs:
        kind = chosen_format(output, format_, LOG_FORMATS)
        log = outputs.add(output, binary=kind != "csv", stream=True)
        beside = [outputs.add(path) if path else None for path in (truth, surfaces)]
        made = simulate(scene, lidar=lidar, noise_m=noise, seed=seed, odometry=not no_odom)
        count = write_log(log.open(), made.scans(), kind)
        if beside[0]:
            text = StringIO()
            write_tum(text, made.truth)
            beside[0].open().write(text.getvalue().encode())
        if beside[1]:
            beside[1].open().write(surfaces_geojson(made.world.surfaces()).encode())
    talk.talk().note(f"{count} scans of {made.lidar.beams} beams, seed {seed}")
