"""`bsmap config`: settings printed, written as a commented file, tested."""

from __future__ import annotations

from typing import Annotated

import typer

from bsmap_cli.cli.options import Force, Json, SettingsFlags, TalkFlags
from bsmap_cli.cli.outputs import Outputs
from bsmap_cli.cli.report import print_json, print_text

HELP = "Print, write or test settings."


def show(
    *,
    settings: SettingsFlags,
    talk: TalkFlags,
    json: Json = False,
) -> None:
    """Print all settings, each with its meaning and the paper's symbol.

    What is printed is what a run with the same --profile, --config and --set would use.

    \b
    Example:
      bsmap config show --profile paper --set ladder=[0.2,0.1]
    """
    from bsmap_cli.config import dump_settings, settings_as_dict

    resolved = settings.settings()
    if json:
        print_json(settings_as_dict(resolved))
    else:
        print_text(dump_settings(resolved))


def init(
    *,
    settings: SettingsFlags,
    talk: TalkFlags,
    output: Annotated[
        str, typer.Argument(metavar="FILE", help="Where to write; `-` is standard output.")
    ] = "bsmap.yaml",
    force: Force = False,
) -> None:
    """Write a commented settings file to edit; `bsmap.yaml` where no name is given.

    \b
    Example:
      bsmap config init robot.yaml
      bsmap slam run.mcap -c robot.yaml -o map.bsm
    """
    from bsmap_cli.config import dump_settings

    with Outputs(force=force) as outputs:
        target = outputs.add(output)
        target.open().write(dump_settings(settings.settings()).encode())
    talk.talk().note(f"wrote {output}: edit it, then give it with --config")


def check(
    *,
    talk: TalkFlags,
    file: Annotated[str, typer.Argument(metavar="FILE", help="The settings file.")],
) -> None:
    """Test a settings file: exit 0 where a run would accept it, else 2 and the line at fault.

    \b
    Example:
      bsmap config check robot.yaml
    """
    from bsmap_cli.config import load_settings

    load_settings(file=file)
    print_text(f"{file}: good\n")


subcommands = {"show": show, "init": init, "check": check}
