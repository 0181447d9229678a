"""The kernels that are compiled ahead are those that runs call, for the types that they hand over.

`pytest tests/pipeline/test_kernel_table.py --rewrite-golden` writes the table anew.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numba import typeof

from bsmap_cli.geometry.compiled import ROOMS
from bsmap_cli.mapping.continuity import GapRule
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.least_surface import LeastSurface
from bsmap_cli.pipeline.kernel_table import TABLE, described, kernel_table, numba_type

ROOT = Path(__file__).parents[2]
# the package is the one that is installed, for which kernels are compiled already
REHEARSE = f"""
import runpy, sys
sys.path.append({str(ROOT)!r})
runpy.run_module("tests.pipeline.rehearsals", run_name="__main__")
"""


def rehearsed():
    """What a process says that found all of them compiled."""
    for _ in range(2):
        ran = subprocess.run(
            [sys.executable, "-P", "-c", REHEARSE],
            check=True,
            stdout=subprocess.PIPE,
            env=os.environ,
        )
    return json.loads(ran.stdout)


def rewritten(entries):
    """One kernel a line, in the order that the table has; new ones at the end."""
    known = list(kernel_table()) if TABLE.exists() else []
    order = [name for name in known if name in entries]
    order += [name for name in entries if name not in order]
    lines = (f"{json.dumps(name)}: {json.dumps(entries[name])}" for name in order)
    TABLE.write_text("{\n" + ",\n".join(lines) + "\n}\n", encoding="utf-8")


def test_the_table_holds_what_is_called(rewrite_golden):
    found = rehearsed()
    if rewrite_golden:
        rewritten(found)
        kernel_table.cache_clear()
    known = {name: entry._asdict() for name, entry in kernel_table().items()}
    assert known == found


@pytest.mark.parametrize(
    "value",
    [
        3,
        0.5,
        True,
        np.zeros((2, 3), np.uint8),
        np.frombuffer(b"12345678"),
        (1, 2),
        (1, 2.0, np.zeros(3, bool)),
        CurveMap(0.1, 3).arrays,
        (CurveMap(0.1, 3).arrays, 1),
        LeastSurface(1, 2.0, 3, 4.0),
        GapRule(1.0, 2.0, 3.0, 4.0, 5.0),  # all of one type
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_described_type_is_found_again(value):
    told = json.loads(json.dumps(described(typeof(value))))
    assert numba_type(told) == typeof(value)


def test_what_is_kept_on_disk_goes_with_the_sources_of_every_room_that_has_kernels():
    assert {name.split(".")[0] for name in kernel_table()} <= set(ROOMS)
