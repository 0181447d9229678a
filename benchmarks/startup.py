"""How long `bsmap` takes to start: median and least of some runs, in seconds.

python benchmarks/startup.py
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

ROOT = Path(__file__).parent.parent
RUNS = 15
BSMAP = Path(sys.executable).with_name("bsmap")


def timed(*arguments: str) -> list[float]:
    """Seconds of each run of one command; the first, which fills the caches, is not counted."""
    seconds = []
    for _ in range(RUNS + 1):
        began = perf_counter()
        subprocess.run([BSMAP, *arguments], check=True, capture_output=True)
        seconds.append(perf_counter() - began)
    return seconds[1:]


def main() -> None:
    """Print one line for each command."""
    with tempfile.TemporaryDirectory() as folder:
        made = f"{folder}/map.bsm"
        log = str(ROOT / "sample_logs" / "spin.bag")
        subprocess.run([BSMAP, "slam", log, "-o", made], check=True, capture_output=True)
        commands = {
            "--help": ("--help",),
            "slam --help": ("slam", "--help"),
            "--version": ("--version",),
            "stats": ("stats", made),
            "config show": ("config", "show"),
            "info": ("info", log),
            "slam, 65 scans": ("slam", log, "-f", "-o", made),
        }
        print(f"{'command':<16}{'median':>8}{'least':>8}")
        for name, arguments in commands.items():
            seconds = timed(*arguments)
            print(f"{name:<16}{statistics.median(seconds):>8.3f}{min(seconds):>8.3f}")


if __name__ == "__main__":
    main()
