"""`bsmap eval`: how good a trajectory is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from bsmap_cli.cli.formats import PICTURE_FORMATS, chosen_format
from bsmap_cli.cli.inputs import read_trajectory, text_input
from bsmap_cli.cli.options import Force, Json, TalkFlags, option
from bsmap_cli.cli.outputs import Outputs
from bsmap_cli.cli.report import print_json, print_rows
from bsmap_cli.errors import UsageError

if TYPE_CHECKING:
    from bsmap_cli.evaluation.trajectory_error import AbsoluteError


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
    plot: Annotated[
        str | None,
        option("--plot", metavar="FILE", help="Also draw the error over time: .png, .svg or .pdf."),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Judge a trajectory by a reference, or by relations of its poses.

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
    if relations is not None:
        if plot is not None:
            raise UsageError("--plot draws the error against REF, not against relations")
        report = _against_relations(estimate, relations)
    elif reference is not None:
        with Outputs(force=force, inputs=(estimate, reference)) as outputs:
            picture = _Picture(outputs, plot) if plot is not None else None
            report = _against_reference(estimate, reference, max_dt, delta, picture)
    if json:
        print_json(report)
    else:
        print_rows(_rows(report), talk.talk())


class _Picture:
    """Where the picture of the error goes, refused at once where it cannot go there."""

    def __init__(self, outputs: Outputs, path: str) -> None:
        self._kind = chosen_format(path, None, PICTURE_FORMATS)
        self._target = outputs.add(path)

    def draw(self, error: AbsoluteError) -> None:
        from bsmap_cli.plotting import plot_error, save_figure

        save_figure(plot_error(error), self._target.open(), self._kind)


def _against_reference(
    estimate: str, reference: str, max_dt_s: float, delta_m: float, picture: _Picture | None
) -> dict[str, Any]:
    from bsmap_cli.evaluation.trajectory_error import absolute_error, match_poses, relative_error

    judged, truth = read_trajectory(estimate), read_trajectory(reference)
    matched = match_poses(judged, truth, max_dt_s=max_dt_s)
    absolute = absolute_error(matched)
    if picture is not None:
        picture.draw(absolute)
    return {
        "ate": absolute.as_json(),
        "rpe": relative_error(matched, delta_m=delta_m).as_json(),
        "matched": len(matched.stamps_ns),
        "poses": len(judged),
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
    return [*rows, ("matched", f"{report['matched']} of {report['poses']} poses")]
