"""Kernels compiled from the sources as they stand; import it before anything that imports numba.

numba's cache on disk follows the file of a kernel, not those of the kernels that it calls: after
an edit it may run old code. One cache for each state of the sources rules that out.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "bsmap_cli"


def use_fresh_cache() -> None:
    """Point numba at a cache of this state of the sources; workers inherit it."""
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    state = hashlib.sha256()
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_bytes()
        if b"geometry.compiled import" in text:
            state.update(path.relative_to(PACKAGE).as_posix().encode() + b"\0" + text)
    folder = Path(tempfile.gettempdir()) / f"bsmap-kernels-{state.hexdigest()[:12]}"
    os.environ["NUMBA_CACHE_DIR"] = str(folder)


use_fresh_cache()
