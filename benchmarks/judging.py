"""Run `slam` on a case and say how good the result is."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
from cases import Case

from bsmap_cli.config import Settings
from bsmap_cli.evaluation.map_quality import map_quality
from bsmap_cli.evaluation.redundancy import redundancy
from bsmap_cli.evaluation.relations import Relations, relation_errors
from bsmap_cli.evaluation.trajectory_error import absolute_error, match_poses
from bsmap_cli.evaluation.true_surfaces import cut_surfaces
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.pipeline import Run, run_slam
from bsmap_cli.sensor.trajectory import Trajectory


@dataclass(slots=True, kw_only=True)
class Judged:
    """One row of the table; None where a case has no such truth.

    ate_m : rmse after alignment; end_m, end_deg : the last pose in the frame of the first.
    relation_m, relation_std_m, relation_deg : the relations metric. wall_m : rmse of the curves
    from the true surfaces, away from corners. lost : times; degenerate : share of the scans.
    """

    name: str
    scans: int
    way_m: float
    ate_m: float | None = None
    max_m: float | None = None
    end_m: float | None = None
    end_deg: float | None = None
    relation_m: float | None = None
    relation_std_m: float | None = None
    relation_deg: float | None = None
    wall_m: float | None = None
    lost: int
    degenerate: float
    loops: int
    loops_tried: int
    loops_rejected: int
    curves: int
    control_points: int
    redundancy: float
    seconds: float

    def as_json(self) -> dict[str, object]:
        """The row by the names of its columns."""
        return asdict(self)


def judge(case: Case, settings: Settings, picture: Path | None = None) -> Judged:
    """Run one case; the clock runs from the first scan to the finished map."""
    with case.open() as reader:
        began = perf_counter()
        run = run_slam(reader, settings)
        seconds = perf_counter() - began
    level = run.document.finest
    figures = run.figures
    row = Judged(
        name=case.name,
        scans=figures["scans"],
        way_m=figures["travelled_m"],
        lost=len(figures["tracking_lost"]),
        degenerate=figures["degenerate_share"],
        loops=figures["loops"],
        loops_tried=figures["loops_tried"],
        loops_rejected=figures["loops_rejected"],
        curves=len(level),
        control_points=len(level.weights),
        redundancy=redundancy(level),
        seconds=seconds,
    )
    _judge_by_truth(row, run, case)
    _judge_by_relations(row, run, case)
    if picture is not None:
        _draw(run, case, picture)
    return row


def _judge_by_truth(row: Judged, run: Run, case: Case) -> None:
    if case.truth is None:
        return
    matched = match_poses(run.trajectory, case.truth)
    absolute = absolute_error(matched)
    row.ate_m = absolute.as_json()["rmse_m"]
    row.max_m = float(absolute.translation_m.max())
    first, last = (
        [SE2.from_array(poses[k]) for poses in (matched.estimate, matched.reference)]
        for k in (0, -1)
    )
    ends = [begin.inverse() @ end for begin, end in zip(first, last, strict=True)]
    off = ends[1].inverse() @ ends[0]
    row.end_m, row.end_deg = float(np.hypot(off.x, off.y)), abs(float(np.degrees(off.theta)))
    if case.surfaces is not None:
        quality = map_quality(
            run.document.finest,
            cut_surfaces(case.surfaces()),
            pose_world_map=absolute.pose_reference_estimate,
        )
        row.wall_m = None if quality is None else quality.away_rms_m


def _judge_by_relations(row: Judged, run: Run, case: Case) -> None:
    if case.relations is None:
        return
    errors = relation_errors(run.trajectory, case.relations)
    row.relation_m = float(errors.translation_m.mean())
    row.relation_std_m = float(errors.translation_m.std())
    row.relation_deg = float(errors.rotation_deg.mean())


def _draw(run: Run, case: Case, folder: Path) -> None:
    from bsmap_cli.plotting import plot_map, save_figure

    figure = plot_map(run.document, trajectory=run.trajectory, reference=case.truth)
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f"{case.name.replace('/', '-')}.png").open("wb") as stream:
        save_figure(figure, stream, "png")


def trajectory_figure(trajectory: Trajectory, reference: Trajectory | Relations | None) -> float:
    """ATE rmse against a truth, or mean error of the relations [m]; nan without either."""
    if isinstance(reference, Relations):
        return float(relation_errors(trajectory, reference).translation_m.mean())
    if reference is None:
        return float("nan")
    return absolute_error(match_poses(trajectory, reference)).as_json()["rmse_m"]
