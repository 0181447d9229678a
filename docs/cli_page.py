"""Write docs/cli.md from the commands themselves: `python docs/cli_page.py > docs/cli.md`."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from typing import Any

import typer
import typer.main

from bsmap_cli.cli.app import build_app
from bsmap_cli.cli.help import option_rows, usage_pieces
from bsmap_cli.cli.options import READING, SENSOR, SETTINGS, TALKING

INTRODUCTION = """# The command line

This page is made from the commands by `python docs/cli_page.py > docs/cli.md`; a test compares.
"""

SHARED = (READING, SETTINGS, SENSOR, TALKING)  # headings whose options are listed once, in front


def cli_page() -> str:
    """The page as Markdown."""
    root = typer.main.get_command(build_app([]))
    context = typer.Context(root, info_name="bsmap")
    blocks = [INTRODUCTION, *_text(root.help or "")]
    blocks += _shared(root, context)
    for path, command, inner in _commands(root, context):
        blocks += [f"## {path}\n", *_text(command.help or "")]
        blocks.append(f"```\n{path} {' '.join(usage_pieces(command, inner))}\n```\n")
        for heading, rows in option_rows(command, inner).items():
            if heading not in SHARED:
                blocks.append(_table(heading, rows))
    return "\n".join(blocks)


def _shared(root: Any, context: typer.Context) -> Iterator[str]:
    """The options that many commands have, once."""
    seen: dict[str, dict[str, str]] = {heading: {} for heading in SHARED}
    users: dict[str, list[str]] = {heading: [] for heading in SHARED}
    for path, command, inner in _commands(root, context):
        for heading, rows in option_rows(command, inner).items():
            if heading in SHARED:
                seen[heading].update(rows)
                users[heading].append(path.removeprefix("bsmap "))
    yield "## Shared options\n"
    everybody = len(list(_commands(root, context)))
    for heading in filter(users.get, SHARED):
        yield _table(heading, list(seen[heading].items()))
        if len(users[heading]) < everybody:
            yield f"Taken by: {', '.join(f'`{user}`' for user in users[heading])}.\n"


def _commands(group: Any, context: typer.Context) -> Iterator[tuple[str, Any, typer.Context]]:
    for name, command in group.commands.items():
        inner = typer.Context(command, info_name=name, parent=context)
        if hasattr(command, "commands"):
            yield from _commands(command, inner)
        else:
            yield inner.command_path, command, inner


def _text(help_text: str) -> Iterator[str]:
    """Paragraphs; a block that must keep its lines becomes code."""
    for block in inspect.cleandoc(help_text).split("\n\n"):
        if not block.startswith("\b"):
            yield block.strip() + "\n"
            continue
        lines = block.removeprefix("\b\n").splitlines()
        if not lines[0].startswith(" "):
            yield lines.pop(0) + "\n"
        code = inspect.cleandoc("\n".join(["", *lines]))
        kind = "sh" if code.startswith(("bsmap", "cat")) else ""
        yield f"```{kind}\n{code}\n```\n"


def _table(heading: str, rows: list[tuple[str, str]]) -> str:
    lines = [f"| {heading} | |", "|---|---|"]
    for left, right in rows:
        if "--help" in left:
            continue
        cells = (f"`{left}`".replace("|", "\\|"), right.replace("|", "\\|"))
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    sys.stdout.write(cli_page())
