"""The run of a log through the method: the loop, the timings and the report; it knows no disk."""

from bsmap_cli.pipeline.feed import Onlooker, Progress, Silent
from bsmap_cli.pipeline.localize import Located, run_localize
from bsmap_cli.pipeline.report import full_report
from bsmap_cli.pipeline.runs import Run, run_map, run_slam

__all__ = [
    "Located",
    "Onlooker",
    "Progress",
    "Run",
    "Silent",
    "full_report",
    "run_localize",
    "run_map",
    "run_slam",
]
