"""`bsmap eval`: how good a trajectory is."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from bsmap_cli.cli.inputs import read_trajectory, text_input
from bsmap_cli.cli.options import Json, TalkFlags, option
from bsmap_cli.cli.report import print_json, print_rows
from bsmap_cli.errors import UsageError


def run(
    *,
    talk: TalkFlags,
    estimate: Annotated[
        str, typer.Argument(metavar="EST", help="The trajectory to judge (TUM); `-`: stdin.")
    ],
    reference: Annotated[
        str | None,
        typer.Argument(metavar="REF", help="The true trajectory (TUM); or give --relations."),
    ] = None,
    relations: Annotated[
        str | None,
        option(
            "--relations",
            metavar="FILE",
            help="Verified relations, a line each: t1 t2 x y z roll pitch yaw.",
        ),
    ] = None,
    max_dt: Annotated[
        float,
        option("--max-dt", metavar="S", min=0.0, help="Match poses at most this far apart [s]."),
    ] = 0.02,
    delta: Annotated[
        float,
        option("--delta", metavar="M", min=1e-6, help="Length of the motions that RPE compares."),
    ] = 1.0,
    json: Json = False,
) -> None:
    """Judge a trajectory by a reference, or by relations between its poses.

    With REF: the absolute error after a rigid alignment by least squares (ATE), and the error of
    motions of --delta metres (RPE). With --relations: the metric of Kuemmerle et al. 2009, the
    mean error of the motions between pairs of poses that somebody verified.

    \b
    Example:
      bsmap eval map.tum truth.tum
      bsmap eval intel.tum --relations intel.relations
    """
    if (reference is None) == (relations is None):
        raise UsageError("give a reference trajectory REF, or --relations FILE: one of the two")
    if relations is None:
        assert reference is not None
        report = _against_reference(estimate, reference, max_dt, delta)
    else:
        report = _against_relations(estimate, relations)
    if json:
        print_json(report)
    else:
        print_rows(_rows(report), talk.talk())


def _against_reference(
    estimate: str, reference: str, max_dt_s: float, delta_m: float
) -> dict[str, Any]:
    from bsmap_cli.evaluation.trajectory_error import absolute_error, match_poses, relative_error

    matched = match_poses(read_trajectory(estimate), read_trajectory(reference), max_dt_s=max_dt_s)
    return {
        "ate": absolute_error(matched).as_json(),
        "rpe": relative_error(matched, delta_m=delta_m).as_json(),
        "matched": len(matched.stamps_ns),
    }


def _against_relations(estimate: str, relations: str) -> dict[str, Any]:
    from bsmap_cli.evaluation.relations import parse_relations, relation_errors

    trajectory = read_trajectory(estimate)
    with text_input(relations) as lines:
        return relation_errors(trajectory, parse_relations(lines)).as_json()


def _rows(report: dict[str, Any]) -> list[tuple[str, str]]:
    if "ate" not in report:
        translation, rotation = report["translation"], report["rotation"]
        return [
            ("translation", f"{translation['mean_m']:.4f} +- {translation['std_m']:.4f} m"),
            ("rotation", f"{rotation['mean_deg']:.3f} +- {rotation['std_deg']:.3f} deg"),
            ("relations", f"{report['matched']} of {report['relations']} met"),
        ]
    ate, rpe = report["ate"], report["rpe"]
    rows = [
        ("ATE", f"{ate['rmse_m']:.4f} m rmse, {ate['rotation_rmse_deg']:.3f} deg rmse"),
        ("", f"{ate['mean_m']:.4f} m mean, {ate['median_m']:.4f} median, {ate['max_m']:.4f} max"),
    ]
    if rpe["rmse_m"] is None:
        rows.append(("RPE", f"the way is shorter than {rpe['per']}"))
    else:
        rpe_text = f"{rpe['rmse_m']:.4f} m rmse, {rpe['rmse_deg']:.3f} deg rmse"
        rows.append((f"RPE per {rpe['per']}", rpe_text))
    return [*rows, ("matched", f"{report['matched']} poses")]
