"""Which compiler of numba the kernels are compiled by: its own, or one that leaves out much.

The other (`quick_passes.py`) knows more of numba than it documents. Where numba is newer than what
that was tried with, or differs otherwise, the kernels are compiled as numba does by itself, which
takes longer and gives the same results.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numba

TRIED = ((0, 61), (0, 68))


def quick_compilers() -> tuple[type[Any] | None, type[Any] | None]:
    """The compilers of what Python calls and of what only compiled code calls, if there are any."""
    release = tuple(int(number) for number in numba.__version__.split(".")[:2])
    if not TRIED[0] <= release <= TRIED[1]:
        return None, None
    try:
        passes: Any = import_module("bsmap_cli.geometry.quick_passes")
    except (ImportError, AttributeError):
        return None, None
    return passes.KernelCompiler, passes.PartCompiler
