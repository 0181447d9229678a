"""`bsmap view`: a map as one page for a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from bsmap_cli.cli.formats import PAGE_EXTENSIONS, refuse_extension
from bsmap_cli.cli.inputs import map_source, read_map_file, read_trajectory
from bsmap_cli.cli.options import Force, MapIn, TalkFlags, option
from bsmap_cli.cli.outputs import Outputs
from bsmap_cli.cli.replay import ReplayFlags


def run(
    *,
    talk: TalkFlags,
    map_: MapIn = None,
    output: Annotated[
        str, option("--output", "-o", metavar="FILE", help="The page (.html); `-`: stdout.")
    ],
    traj: Annotated[
        str | None,
        option("--traj", metavar="FILE", help="The path to play, not the map's thinned one."),
    ] = None,
    level: Annotated[
        float | None,
        option("--level", metavar="STEP", help="Show the level of this knot step [m] first."),
    ] = None,
    replay: ReplayFlags,
    force: Force = False,
) -> int:
    """Write a map as one page for a browser: zoom, measure, play.

    The page needs no network. With --log and --traj it shows the scan at each pose.

    \b
    Example:
      bsmap view map.bsm --traj map.tum --log run.mcap -o map.html
    """
    from bsmap_cli.exchange.page import write_page
    from bsmap_cli.exchange.selection import select

    replay.check(traj)
    source = map_source(map_)
    inputs = [path for path in (source, traj, replay.log) if path is not None]
    with Outputs(force=force, inputs=inputs) as outputs:
        target = outputs.add(output)
        refuse_extension(output, PAGE_EXTENSIONS, "the page is HTML: end the name in .html")
        document, _ = read_map_file(source)
        trajectory = read_trajectory(traj) if traj is not None else None
        selection = select(document, level=level, trajectory=trajectory)
        title = Path(source).stem or "map"
        with replay.scans(talk.talk()) as replayed:
            write_page(target.open(), selection, title=title, scans=replayed.scans)
    return replayed.code
