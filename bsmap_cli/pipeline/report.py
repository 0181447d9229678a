"""The report of a run, with the keys that `--json` promises."""

from __future__ import annotations

from typing import Any

from bsmap_cli.pipeline.peak_memory import peak_memory_mb
from bsmap_cli.pipeline.runs import Run

STAGES = ("read", "fit", "register", "merge", "loops", "graph", "final_map", "write")
COUNTS: dict[str, Any] = {
    "scans": 0,
    "scans_used": 0,
    "scans_skipped": 0,
    "keyframes": 0,
    "submaps": 0,
    "loops": 0,
    "loops_tried": 0,
    "loops_rejected": 0,
    "tracking_lost": [],
    "degenerate_share": 0.0,
    "odometry": "none",
}


def full_report(
    run: Run, *, seconds: float, write_s: float, map_report: dict[str, Any] | None = None
) -> dict[str, Any]:
    """The report once the files are written.

    seconds : of the whole command after imports; write_s : of those, for writing; map_report :
    what `stats` tells of the map.
    """
    stages = {name: run.stage_seconds.get(name, 0.0) for name in STAGES} | {"write": write_s}
    tracking_s = stages["fit"] + stages["register"] + stages["merge"]
    scans = run.figures["scans"]
    return {
        **{name: run.figures.get(name, default) for name, default in COUNTS.items()},
        "seconds": round(seconds, 4),
        "stage_seconds": {name: round(value, 4) for name, value in stages.items()},
        "scans_per_second": _rate(scans, seconds),
        "tracking_scans_per_second": _rate(scans, tracking_s),
        "realtime_factor": _rate(run.span_s, seconds) if run.span_s > 0 else None,
        "peak_memory_mb": round(peak_memory_mb(), 1),
        "travelled_m": run.figures["travelled_m"],
        "map": map_report,
        "settings": run.figures["settings"],
    }


def _rate(amount: float, seconds: float) -> float | None:
    return round(amount / seconds, 2) if seconds > 0 else None
