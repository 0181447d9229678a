"""Help pages: options in groups, each with its metavar, the same in the terminal and the docs."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperCommand

Rows = list[tuple[str, str]]

OPTIONS = "Options"


class GroupedCommand(TyperCommand):
    """A command whose help lists its options under the headings of the option registry."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write one block for each heading."""
        for heading, rows in option_rows(self, ctx).items():
            with formatter.section(heading):
                formatter.write_dl(rows)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """What stands behind the command's name in the usage line."""
        return usage_pieces(self, ctx)


def option_rows(command: Any, ctx: typer.Context) -> dict[str, Rows]:
    """Heading -> (option, explanation) rows, arguments first, in the order of declaration."""
    rows: dict[str, Rows] = {}
    for parameter in command.get_params(ctx):
        if getattr(parameter, "hidden", False):
            continue
        heading = getattr(parameter, "rich_help_panel", None)
        if parameter.param_type_name == "argument":
            heading = heading or "Arguments"
        rows.setdefault(heading or OPTIONS, []).append(_row(parameter))
    return dict(sorted(rows.items(), key=lambda item: _rank(item[0])))


def usage_pieces(command: Any, ctx: typer.Context) -> list[str]:
    """`[OPTIONS] LOG...` of one command."""
    arguments = [
        parameter.metavar
        if parameter.required
        else f"[{parameter.metavar}]".replace("...]", "]...")
        for parameter in command.get_params(ctx)
        if parameter.param_type_name == "argument"
    ]
    return ["[OPTIONS]", *arguments]


def _rank(heading: str) -> int:
    return {"Arguments": 0, OPTIONS: 1}.get(heading, 2)


def _row(parameter: Any) -> tuple[str, str]:
    if parameter.param_type_name == "argument":
        return parameter.metavar, parameter.help or ""
    names = ", ".join([*parameter.opts, *parameter.secondary_opts])
    takes_value = not (parameter.is_flag or parameter.count)
    left = f"{names} {parameter.metavar}" if takes_value and parameter.metavar else names
    default = parameter.default
    shown = takes_value and default is not None and parameter.show_default
    return left, (parameter.help or "") + (f" [default: {default}]" if shown else "")
