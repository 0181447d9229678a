"""All kernels compiled ahead of the first run, for images and shared machines."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from bsmap_cli.pipeline.compile_ahead import compile_ahead
from bsmap_cli.pipeline.kernel_table import kernel_table, named


@dataclass(frozen=True, slots=True)
class WarmUp:
    """How many kernels there are, how many were compiled now, and where they are kept.

    Those that other kernels call are compiled, too, and not among the kernels.
    """

    kernels: int
    compiled: int
    folder: Path


def warm_up() -> WarmUp:
    """Compile what is not compiled yet for this machine and this state of the sources."""
    names = list(kernel_table())
    compiled = compile_ahead(names)
    folders = [named(name).stats.cache_path for name in names]
    return WarmUp(len(names), len(compiled), Path(os.path.commonpath(folders)))
