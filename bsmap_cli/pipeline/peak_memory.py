"""The most memory a process has held. The standard library alone: benchmarks load this file."""

from __future__ import annotations

import re
import sys
from pathlib import Path

STATUS = Path("/proc/self/status")


def peak_memory_mb() -> float:
    """The most memory that this process has held [MB].

    Linux counts that of the process which started this one into `ru_maxrss`, so its own peak is
    asked for first.
    """
    try:
        own = re.search(r"^VmHWM:\s*(\d+) kB$", STATUS.read_text(), re.MULTILINE)
    except OSError:
        own = None
    if own:
        return int(own[1]) * 1024 / 1e6
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6
