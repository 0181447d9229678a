"""The installed command, run as a user runs it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

BIN = Path(sys.executable).parent
BSMAP = BIN / "bsmap"


def environment(**changes):
    """The user's environment with the tested command first on the path and no colors."""
    base = {name: value for name, value in os.environ.items() if name not in {"FORCE_COLOR", "CI"}}
    return {**base, "PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}", "NO_COLOR": "1", **changes}


def bsmap(*arguments, cwd=None, stdin=subprocess.DEVNULL, **changes):
    """Run one command; `stdin` may be bytes."""
    given = {"input": stdin} if isinstance(stdin, bytes) else {"stdin": stdin}
    ran = subprocess.run(
        [BSMAP, *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        check=False,
        env=environment(**changes),
        timeout=240,
        **given,
    )
    assert b"Traceback" not in ran.stderr, ran.stderr.decode()
    return ran


def shell(line, cwd):
    """Run a line of bash that fails where any part of a pipe fails."""
    ran = subprocess.run(
        ["bash", "-o", "pipefail", "-c", line],
        cwd=cwd,
        capture_output=True,
        check=False,
        env=environment(),
        timeout=240,
    )
    assert b"Traceback" not in ran.stderr, ran.stderr.decode()
    return ran


def message(ran):
    """What was said on standard error, which is one line."""
    lines = ran.stderr.decode().splitlines()
    assert len(lines) == 1, lines
    return lines[0]


def names(folder):
    """Every file below a folder, hidden ones too."""
    return sorted(str(path.relative_to(folder)) for path in Path(folder).rglob("*"))
