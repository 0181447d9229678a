"""One stage changed or switched off at a time, by settings alone."""

from __future__ import annotations

from fnmatch import fnmatch
from pathlib import Path
from typing import Any

from cases import Case, logs_in, recorded_case, simulated_case
from judging import Judged, judge

from bsmap_cli.config import load_settings

CHANGES: dict[str, tuple[str, ...]] = {
    "as built": (),
    "one level, 0.1 m": ("ladder=[0.1]",),
    "one level, 0.2 m": ("ladder=[0.2]",),
    "levels 0.8/0.4/0.2": ("ladder=[0.8,0.4,0.2]",),
    "each level segmented anew": ("segmentation.each_level=true",),
    "constant longest gap, eq. (3)": ("segmentation.beam_gap=false",),
    "no thinning": ("fitting.thinning=0",),
    "no fit penalty": ("fitting.penalty=0", "fitting.first_penalty=0"),
    "merging by Table I": ("merging.method=table",),
    "no weight cap (255)": ("merging.max_weight=255",),
    "curves jointly on the coarsest": ("registration.method=joint_first",),
    "curves jointly on all levels": ("registration.method=joint",),
    "no degeneracy test": ("registration.degenerate=0",),
    "wide kernel": ("registration.kernel=100",),
    "no recovery search": ("recovery.search_below=0",),
    "no wider search after gaps": ("recovery.widest=1",),
    "fixed motion prior": ("prediction.motion_floor=0.3",),
    "every scan a keyframe": ("keyframes.distance=0",),
    "submaps of 20": ("submaps.keyframes=20",),
    "submaps of 80": ("submaps.keyframes=80",),
    "no loop closure": ("loops.enabled=false",),
    "no final rounds": ("final_map.rounds=0",),
    "one final round": ("final_map.rounds=1",),
    "final rounds on the finest level": ("final_map.levels=1",),
    "the map as tracking built it": ("final_map.rebuild=false",),
}
SIMULATED = (
    ("loop", "lms200", True, ""),
    ("loop", "ust10lx", False, ""),
    ("office", "urg04lx", False, ""),
    ("hallway", "lms200", False, ""),
    ("loop", "lms200", True, "gap"),
)


def _cases(logs: list[Path], only: list[str] | None) -> list[Case]:
    cases = [recorded_case(path, odometry=on) for path in logs_in(logs) for on in (True, False)]
    cases += [
        simulated_case(scene, lidar, odometry=odometry, variant=variant)
        for scene, lidar, odometry, variant in SIMULATED
    ]
    return [c for c in cases if not only or any(fnmatch(c.name, pattern) for pattern in only)]


def _figure(row: Judged) -> str:
    """Mean +- deviation of the relations [cm], or the ATE; a cross for each time it was lost."""
    text = f"{100 * row.ate_m:.2f}" if row.ate_m is not None else ""
    if row.relation_m is not None and row.relation_std_m is not None:
        text = f"{100 * row.relation_m:.2f}+-{100 * row.relation_std_m:.2f}"
    return text + "x" * min(row.lost, 3)


def print_ablation(
    logs: list[Path], only: list[str] | None, overrides: list[str]
) -> list[dict[str, Any]]:
    """A line for each change, a column for each case, then redundancy and seconds in all."""
    cases = _cases(logs, only)
    print("ATE rmse, or error of the relations +- deviation [cm]; x: tracking lost")
    print(f"{'change':<34}" + "".join(f"{case.name:>26}" for case in cases), end="")
    print(f"{'redundancy':>12}{'seconds':>9}", flush=True)
    rows = []
    for name, change in CHANGES.items():
        settings = load_settings(overrides=[*overrides, *change])
        judged = [judge(case, settings) for case in cases]
        rows += [{"change": name, "settings": list(change), **row.as_json()} for row in judged]
        print(f"{name:<34}" + "".join(f"{_figure(row):>26}" for row in judged), end="")
        mean = sum(row.redundancy for row in judged) / len(judged)
        print(f"{mean:>12.3f}{sum(row.seconds for row in judged):>9.1f}", flush=True)
    return rows
