"""When tracking slips: search round every place the robot may be, and keep what fits best."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bsmap_cli.geometry.se2 import Points, Vector, wrap_angle
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.settings import setting
from bsmap_cli.slam.ladder import register_down
from bsmap_cli.slam.registration import RegistrationResult, RegistrationSettings
from bsmap_cli.slam.search_window import Window
from bsmap_cli.slam.submap import Submap
from bsmap_cli.slam.wide_search import search

HEIGHTS = 4  # of the likelihood pyramid: blocks of 8 cells at the top
LEAST_SCORE = 0.2  # of a place worth refining
CELL_STEPS = 1.0  # cell of the likelihood [finest knot steps]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoverySettings:
    """When to search, how far, and when to give up."""

    search_below: float = setting(
        0.6, "a smaller share of points on the map starts a search", minimum=0.0, maximum=1.0
    )
    lost_below: float = setting(
        0.35,
        "a smaller share after the search means that tracking is lost",
        minimum=0.0,
        maximum=1.0,
    )
    gain: float = setting(0.05, "a search result must be better by this share", minimum=0.0)
    odometry_gain: float = setting(
        0.15, "and by this more for each deviation that it lies off the odometry", minimum=0.0
    )
    reach: float = setting(
        4.0, "half width of the search round a guess [finest knot steps]", minimum=0.0
    )
    reach_deg: float = setting(35.0, "half width of its angles", minimum=0.0, maximum=180.0)
    gap: float = setting(
        8.0, "usual scan times that make a gap in a log without odometry", minimum=1.0
    )
    widest: float = setting(10.0, "times that a gap widens the search, at most", minimum=1.0)
    patience: int = setting(
        3, "scans in a row that must be lost before a new submap is begun", minimum=1
    )


def recover(
    submap: Submap,
    clusters: Sequence[Clusters],
    guesses: list[tuple[Vector, float]],
    best: RegistrationResult,
    prior_information: Points,
    *,
    reach_rad: float,
    sigma_m: float,
    surely: bool,
    believed: Points | None,
    recovery: RecoverySettings,
    registration: RegistrationSettings,
) -> RegistrationResult:
    """Search round each guess (pose, reach [m]) and refine; `best` stays unless clearly beaten.

    Odometry has jumps of its own and the last pose knows nothing of a gap in the log: both are
    guesses. What is found is refined without a prior, as the guess it came from may be far off.
    surely : nothing is believed that leaves a direction unobserved, unless all else is lost.
    believed : (3, 3) information of the prediction, the first guess, where it is worth anything.
    What contradicts it must fit better by more: the farther a robot drives between two scans, the
    better the second fits where the first was taken, since there the map is; and after a gap many
    a place looks fairly like the right one.
    """
    cell_m = CELL_STEPS * submap.levels[-1].knot_step_m
    likelihood = submap.likelihood(cell_m=cell_m, heights=HEIGHTS)
    coarse = clusters[max(0, len(clusters) - 2)]
    here = search(
        likelihood, coarse.points, coarse.tangents, Window(best.pose, 0.0, 0.0), floor=0.0
    )
    floor = max(LEAST_SCORE, here.score if here else 0.0)  # what scores less will not fit better
    wary = (surely or believed is not None) and best.inlier_ratio >= recovery.lost_below
    for pose, reach_m in guesses:
        window = Window(pose, reach_m, reach_rad)
        peak = search(likelihood, coarse.points, coarse.tangents, window, floor=floor)
        if peak is None:
            continue
        loose = prior_information * 1e-4
        found = register_down(
            submap.levels,
            clusters,
            peak.pose,
            peak.pose,
            loose,
            sigma_m=sigma_m,
            settings=registration,
        )
        gain = recovery.gain
        if found.degenerate and wary:
            continue
        if believed is not None:
            gain += recovery.odometry_gain * _contradiction(found.pose, guesses[0][0], believed)
        if found.inlier_ratio > best.inlier_ratio + gain:
            best = found
    return best


def _contradiction(pose: Vector, predicted: Vector, information: Points) -> float:
    """How many deviations a pose lies off the prediction; more than two mean as much as two."""
    x, y, turn = pose - predicted
    off = np.array([x, y, wrap_angle(turn)])
    return min(2.0, math.sqrt(float(off @ information @ off)))
