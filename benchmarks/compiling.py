"""What compiling costs in a fresh environment: seconds of processor time for each kernel.

python benchmarks/compiling.py [slam LOG -o MAP.bsm ...]     without arguments: all, as by warmup

A kernel that is compiled more than once is called with arrays or numbers of several types; what
belongs to numba itself is summed up in one line.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections import defaultdict
from time import process_time
from typing import Any

CACHE = tempfile.TemporaryDirectory()
os.environ["NUMBA_CACHE_DIR"] = CACHE.name  # numba reads it when it is imported

from numba.core import event  # noqa: E402


class Stopwatch(event.Listener):
    """Processor time by kernel, without that of the kernels which it calls."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.variants: dict[str, int] = defaultdict(int)
        self._open: list[list[float]] = []

    def on_start(self, event: Any) -> None:
        """A kernel's compilation begins, perhaps inside that of another."""
        self._open.append([process_time(), 0.0])

    def on_end(self, event: Any) -> None:
        """It is done."""
        began, inner = self._open.pop()
        whole = process_time() - began
        if self._open:
            self._open[-1][1] += whole
        function = event.data["dispatcher"].py_func
        own = function.__module__.startswith("bsmap_cli.")
        name = f"{function.__module__[10:]}.{function.__name__}" if own else "numba's own"
        self.seconds[name] += whole - inner
        self.variants[name] += 1


def main() -> int:
    """Run one command in an empty cache and print the table; its exit code."""
    stopwatch = Stopwatch()
    event.register("numba:compile", stopwatch)
    from bsmap_cli.cli.door import run

    code = run(sys.argv[1:] or ["warmup"])
    for name, seconds in sorted(stopwatch.seconds.items(), key=lambda item: -item[1]):
        print(f"{seconds:8.2f} s {stopwatch.variants[name]:4d}  {name}")
    print(f"{sum(stopwatch.seconds.values()):8.2f} s {sum(stopwatch.variants.values()):4d}  in all")
    return code


if __name__ == "__main__":
    sys.exit(main())
