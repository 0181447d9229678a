"""The command `bsmap`: which verbs there are, each in a module of its own."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated

import typer

from bsmap_cli import __version__
from bsmap_cli.cli.command import command
from bsmap_cli.cli.help import GroupedCommand

VERBS = (
    *(
        "slam",
        "map",
        "localize",
        "stats",
        "info",
        "check",
        "eval",
        "export",
        "plot",
        "view",
        "query",
        "diff",
        "merge",
        "sim",
        "scans",
        "warmup",
    ),
    "config",
)

HELP = """Turn logs of 2D range scans into compact B-spline maps and trajectories.

A log is an MCAP file, a ROS 1 bag, a ROS 2 bag directory, a CARMEN log or a CSV file; its
format is known from its content. `-` is standard input or output.

\b
  bsmap slam run.mcap -o map.bsm --traj map.tum  # a map and a trajectory
  bsmap stats map.bsm                            # what the map holds
  bsmap plot map.bsm --traj map.tum -o map.png   # a picture of both

Exit codes: 0 done; 1 could not; 2 usage or settings; 3 done, but something was lost;
130 interrupted.
"""

CONTEXT = {"help_option_names": ["-h", "--help"], "max_content_width": 100}


def build_app(arguments: Sequence[str]) -> typer.Typer:
    """The parser; when the arguments name a verb, only that verb's module is imported."""
    app = typer.Typer(
        name="bsmap",
        help=HELP,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        context_settings=CONTEXT,
    )
    app.callback(invoke_without_command=True)(_root)
    for verb in _wanted(arguments):
        module = import_module(f"bsmap_cli.cli.verbs.{verb}")
        if hasattr(module, "subcommands"):
            group = typer.Typer(name=verb, help=module.HELP, rich_markup_mode=None)
            for name, function in module.subcommands.items():
                group.command(name, cls=GroupedCommand)(command(function))
            app.add_typer(group)
        else:
            settings = getattr(module, "CONTEXT", None)
            add = app.command(verb, cls=GroupedCommand, context_settings=settings)
            add(command(module.run))
    return app


def _wanted(arguments: Sequence[str]) -> Sequence[str]:
    first = next((argument for argument in arguments if not argument.startswith("-")), None)
    if list(arguments) == ["--version"]:
        return []
    return [first] if first in VERBS and "_BSMAP_COMPLETE" not in os.environ else VERBS


def _root(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version.")] = False,
) -> None:
    if version:
        typer.echo(f"bsmap {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help(), err=True)
        raise typer.Exit(2)
