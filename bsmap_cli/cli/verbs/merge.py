"""`bsmap merge`: one map from two."""

from __future__ import annotations

from typing import Annotated

from bsmap_cli.cli.formats import refuse_no_map
from bsmap_cli.cli.options import Force, SettingsFlags, TalkFlags, option
from bsmap_cli.cli.outputs import Outputs
from bsmap_cli.cli.placing import At, FirstMap, SecondMap, placed, read_two
from bsmap_cli.cli.report import size


def run(
    *,
    talk: TalkFlags,
    a: FirstMap,
    b: SecondMap,
    output: Annotated[
        str, option("--output", "-o", metavar="MAP", help="The merged map; `-`: stdout.")
    ],
    at: At = None,
    compress: Annotated[
        bool, option("--compress", help="Write 3 bytes a control point, not 9 (rounds to 1 mm).")
    ] = False,
    settings: SettingsFlags,
    force: Force = False,
) -> None:
    """Make one map from two.

    B is placed in the frame of A: searched for in the whole of it and refined, or with --at
    looked for near a pose given by hand. Walls that both have become one, each control point by
    its weight; the rest of B is added. The merged map has the frame, the degree and the knot
    steps of A, and the paths of both. What has changed from one to the other is in it twice, as
    a map alone does not tell which is the later; to mend a map with a log, use `bsmap slam --map`.

    Where nothing is found in common, or more than one place fits, the exit code is 1.

    \b
    Example:
      bsmap merge map.bsm old.bsm -o merged.bsm
      bsmap merge map.bsm old.bsm --at 0,0,0 -o merged.bsm
    """
    from io import BytesIO

    from bsmap_cli.mapping.map_file import write_map
    from bsmap_cli.pipeline.two_maps import merge_maps

    voice = talk.talk()
    with Outputs(force=force, inputs=(a, b)) as outputs:
        target = outputs.add(output, binary=True)
        refuse_no_map(output)
        first, second = read_two(a, b)
        chosen = settings.settings()
        placement = placed(first, second, at, chosen, voice)
        document = merge_maps(first, second, placement, chosen)
        encoded = BytesIO()
        sizes = write_map(encoded, document, compress=compress)
        target.open().write(encoded.getbuffer())
    curves = len(document.finest)
    voice.note(f"merged: {curves} curves, map {size(sizes.file_bytes)}")
