"""`bsmap sim`: a made-up log with true poses and true surfaces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from bsmap_cli.cli.formats import LOG_FORMATS, chosen_format
from bsmap_cli.cli.options import Force, TalkFlags, option
from bsmap_cli.cli.outputs import Outputs, write_trajectory


@dataclass(frozen=True, slots=True, kw_only=True)
class ImitationFlags:
    """How the sensors are imitated."""

    lidar: Annotated[str, option("--lidar", metavar="NAME", help="The lidar that is imitated.")] = (
        "ust10lx"
    )
    noise: Annotated[
        float | None,
        option("--noise", metavar="M", min=0.0, help="Range noise [m], instead of the lidar's."),
    ] = None
    seed: Annotated[int, option("--seed", metavar="N", min=0, help="Of all that is random.")] = 0
    no_odom: Annotated[bool, option("--no-odom", help="Leave odometry out of the log.")] = False


def run(
    *,
    talk: TalkFlags,
    scene: Annotated[
        str,
        typer.Argument(metavar="SCENE", help="One of the scenes above."),
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
    imitation: ImitationFlags,
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
      wall      12 m along a wall with niches and pilasters
      spin      360 degrees on the spot in a room
      shapes    geometric shapes in a room of 10 m by 8 m
      loop      a ring of corridors, 30 m by 20 m, twice round
      corridor  bare parallel walls without an end in sight
      twins     two identical rooms joined by a corridor
      hallway   a corridor of 110 m between two lobbies, and back
      office    a corridor and the furnished rooms beside it
      campus    2 km round a campus
      people    a hall through which people walk
      yard      a loading yard with vans that come and go
      changes   a room where a box is taken away half way

    Lidars: ust10lx, utm30lx, lms200, lms200half, urg04lx, lowcost360.

    \b
    Example:
      bsmap sim wall -o wall.mcap --truth wall.tum --surfaces wall.geojson
    """
    from bsmap_cli.exchange.log_writers import write_log
    from bsmap_cli.exchange.surfaces import surfaces_geojson
    from bsmap_cli.sensor.simulator.simulation import simulate

    with Outputs(force=force) as outputs:
        kind = chosen_format(output, format_, LOG_FORMATS)
        log = outputs.add(output, binary=kind != "csv", stream=True)
        beside = [outputs.add(path) if path else None for path in (truth, surfaces)]
        made = simulate(
            scene,
            lidar=imitation.lidar,
            noise_m=imitation.noise,
            seed=imitation.seed,
            odometry=not imitation.no_odom,
        )
        count = write_log(log.open(), made.scans(), kind)
        if beside[0]:
            write_trajectory(beside[0], made.truth)
        if beside[1]:
            beside[1].open().write(surfaces_geojson(made.world.surfaces()).encode())
    talk.talk().note(f"{count} scans of {made.lidar.beams} beams, seed {made.seed}")
