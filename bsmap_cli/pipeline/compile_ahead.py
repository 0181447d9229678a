"""Compile kernels before they are called, on all cores: the first run waits half as long.

Helpers are processes that go through the same kernels; who first makes a file of a kernel's name in
a folder of theirs compiles it, and writes into the file what was compiled.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from bsmap_cli.beside import usable_cores
from bsmap_cli.pipeline.kernel_table import PACKAGE, kernel_table, named, numba_type

MOST_HELPERS = 3  # more would be done before they have started
HELPER = f"""
import sys
sys.path.insert(0, sys.argv[1])
import {PACKAGE}
sys.path.append(sys.path.pop(0))
from {__name__} import help_compiling
help_compiling(*sys.argv[2:])
"""
"""The same package as here, wherever it lies, and else what Python finds by itself."""


def compile_for_slam() -> None:
    """Compile all that `slam` needs, unless that has been done or there is but one core.

    Kernels that are missing later, for whatever reason, are compiled as they are called.
    """
    names = [name for name, entry in kernel_table().items() if entry.in_slam]
    if _helpers() and _compile(names[-1]):
        with suppress(OSError):  # no room for a folder, or no process to be had
            compile_ahead(names[:-1])


def compile_ahead(names: Sequence[str]) -> set[str]:
    """Compile these kernels where they are not on the disk; the names of all that were compiled."""
    with TemporaryDirectory(prefix="bsmap-compiling-") as folder:
        helpers = [_start_helper(folder, names) for _ in range(_helpers())]
        try:
            _compile_share(Path(folder), names)
            for helper in helpers:
                helper.wait()
        finally:
            for helper in helpers:
                helper.kill()
                helper.wait()
        return {name for note in Path(folder).iterdir() for name in note.read_text().split()}


def _helpers() -> int:
    if not Path(sys.executable or "").name.startswith("python"):
        return 0  # another program that holds Python: it must not be started anew
    return min(usable_cores() - 1, MOST_HELPERS)


def _start_helper(folder: str, names: Sequence[str]) -> subprocess.Popen[bytes]:
    home = str(Path(sys.modules[PACKAGE].__path__[0]).parent)
    return subprocess.Popen(
        # -P: what lies in the working folder is none of its modules
        [sys.executable, "-P", "-c", HELPER, home, folder, *names],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,  # what it cannot compile is compiled when it is called
    )


def _compile_share(folder: Path, names: Sequence[str]) -> None:
    """Compile what nobody else has begun with."""
    for name in names:
        with suppress(FileExistsError):
            (folder / name).touch(exist_ok=False)
            (folder / name).write_text("\n".join(_compile(name)))


def _compile(name: str) -> set[str]:
    """Compile a kernel, or find it on the disk; what was compiled with it."""
    kernel: Any = named(name)
    before = freshly_compiled()
    kernel.compile(tuple(map(numba_type, kernel_table()[name].types)))
    return freshly_compiled() - before


def freshly_compiled() -> set[str]:
    """The kernels that this process has compiled, and not found on the disk."""
    found = set()
    for module_name, module in list(sys.modules.items()):
        if module_name.split(".")[0] != PACKAGE:
            continue
        for value in list(vars(module).values()):
            if hasattr(value, "py_func") and sum(value.stats.cache_misses.values()):
                function = value.py_func
                found.add(f"{function.__module__}.{function.__qualname__}")
    return found


def help_compiling(folder: str, *names: str) -> None:
    """Be a helper."""
    _compile_share(Path(folder), names)
