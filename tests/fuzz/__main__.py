"""Fuzz one reader with atheris until something breaks.

python -m tests.fuzz TARGET [FOLDER] [-max_total_time=3600] [-runs=...]

TARGET is a name of `targets.TARGETS`; FOLDER keeps what was found interesting, for the next time.
An input that breaks a reader is left as `crash-*` in the current folder; to see it again, name it
instead of FOLDER.
"""

from __future__ import annotations

import resource
import sys
import tempfile
from pathlib import Path

import atheris

ROOM_BYTES = 512 << 20
"""Memory beyond what the imports take: a declared length that is believed ends the run."""

PAGE_BYTES = resource.getpagesize()
LONGEST_REFUSAL = 1000


def main(arguments: list[str]) -> None:
    name = arguments[1] if len(arguments) > 1 else ""
    with atheris.instrument_imports(include=["bsmap_cli", "rosbags"]):
        from tests.fuzz.targets import TARGETS

        if name not in TARGETS:
            sys.exit(f"{__doc__}\ntargets: {', '.join(TARGETS)}")
        target = TARGETS[name]()
        for seed in target.seeds:
            target.read(seed)  # imports what is imported where it is used

    def try_one(data: bytes) -> None:
        try:
            target.read(data)
        except target.refusals as refusal:
            assert 0 < len(str(refusal)) < LONGEST_REFUSAL

    with tempfile.TemporaryDirectory() as seeds:
        for index, seed in enumerate(target.seeds):
            Path(seeds, f"seed_{index}").write_bytes(seed)
        taken = int(Path("/proc/self/statm").read_text().split()[0]) * PAGE_BYTES
        resource.setrlimit(resource.RLIMIT_AS, (taken + ROOM_BYTES, taken + ROOM_BYTES))
        given = arguments[2:]
        places = [] if any(Path(item).is_file() for item in given) else [seeds]
        atheris.Setup([arguments[0], "-timeout=20", "-max_len=8192", *given, *places], try_one)
        atheris.Fuzz()


if __name__ == "__main__":
    main(sys.argv)
