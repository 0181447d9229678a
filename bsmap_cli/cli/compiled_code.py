"""Where compiled code is kept from run to run; somewhere, even where nothing may be written."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
from collections.abc import Mapping, MutableMapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import bsmap_cli
from bsmap_cli.cli.talk import Talk
from bsmap_cli.errors import BsmapError

CACHE_VARIABLE = "NUMBA_CACHE_DIR"
BLAS = "scipy.linalg.cython_blas"
FOR_ONCE = "bsmap-once-"
ROOM_BYTES = 32 << 20
"""Several times what the compiled code takes: a full disk must not end a run."""


def keep_compiled_code(talk: Talk, environment: MutableMapping[str, str] = os.environ) -> None:
    """Give the compiler a folder for this run, where neither package nor home has room."""
    if CACHE_VARIABLE in environment or _can_be_made(Path(bsmap_cli.__file__).parent):
        return
    home = Path(os.path.expanduser("~"))
    if _can_be_made(Path(environment.get("XDG_CACHE_HOME") or home / ".cache")):
        return
    folder = tempfile.mkdtemp(prefix=FOR_ONCE)
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    environment[CACHE_VARIABLE] = folder
    talk.detail(f"compiled code cannot be kept: set {CACHE_VARIABLE} to a folder for it")


def start_compiler() -> None:
    """Import the part of numba that looks for scipy's BLAS while there is none to be found.

    That would take a fifth of a second of each run, and no kernel multiplies matrices.
    """
    if BLAS in sys.modules:
        return
    sys.modules[BLAS] = None  # type: ignore[assignment]
    try:
        with suppress(ImportError):
            import_module("numba.np.arraymath")
    finally:
        del sys.modules[BLAS]


def compiled_note(seconds: float, environment: Mapping[str, str] = os.environ) -> str:
    """What to say of the time that compiling took up to the first scan."""
    later = "later runs start at once"
    if _is_for_once(environment):
        later = f"set {CACHE_VARIABLE} to keep that"
    return f"compiling for this machine took {seconds:.0f} s so far, the rest as needed; {later}"


def check_kept(environment: Mapping[str, str] = os.environ) -> None:
    """Refuse to compile where that would be lost with the run.

    Raises
    ------
    BsmapError : there is no folder for compiled code that can be written and has room.
    """
    folder = environment.get(CACHE_VARIABLE)
    if folder is not None and (_is_for_once(environment) or not _can_be_made(Path(folder))):
        place = "neither beside the package nor in the home folder"
        if not _is_for_once(environment):
            place = f"not in {folder}"
        raise BsmapError(
            f"compiled code cannot be kept, {place}: set {CACHE_VARIABLE} to a folder that can "
            "be written, on a disk with room"
        )


def _is_for_once(environment: Mapping[str, str]) -> bool:
    return Path(environment.get(CACHE_VARIABLE, "")).name.startswith(FOR_ONCE)


def _can_be_made(folder: Path) -> bool:
    """Whether the folder, or the nearest one above it that exists, can be written and has room."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    if not (folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)):
        return False
    return shutil.disk_usage(folder).free >= ROOM_BYTES
