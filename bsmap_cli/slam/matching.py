"""Where a scan lies on a submap: register down the ladder, and search where that fails."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.slam.ladder import track_down
from bsmap_cli.slam.prediction import Prediction
from bsmap_cli.slam.recovery import recover
from bsmap_cli.slam.registration import RegistrationResult
from bsmap_cli.slam.submap import Submap

if TYPE_CHECKING:
    from bsmap_cli.slam.slam_settings import SlamSettings

FEWEST_POINTS = 10  # a scan with fewer says nothing about being lost


def match_scan(
    submap: Submap,
    clusters: list[Clusters],
    last: SE2,
    prediction: Prediction,
    *,
    blind: float,
    growing: bool = True,
    sigma_m: float,
    settings: SlamSettings,
) -> RegistrationResult:
    """Register the scan that follows the one at `last`, a pose in the submap's frame.

    blind : usual scan times that passed without odometry; in a gap the robot may have gone
    anywhere near, and even a fair match may be of another place. growing : the map ends where the
    robot has been, and not where the walls do.
    """
    predicted = (last @ prediction.step).as_array()
    information = prediction.information()
    result = track_down(
        submap.levels,
        clusters,
        predicted,
        predicted,
        information,
        sigma_m=sigma_m,
        settings=settings,
    )
    recovery = settings.recovery
    gap = blind > recovery.gap
    fair = result.inlier_ratio >= recovery.search_below
    if (fair and not gap) or result.points < FEWEST_POINTS:
        return result
    wider = min(blind, recovery.widest) if gap else 1.0
    reach_m = recovery.reach * settings.ladder[-1] * wider
    way = math.hypot(prediction.step.x, prediction.step.y)
    guesses = [(predicted, reach_m + 0.5 * way), (last.as_array(), reach_m + way)]
    return recover(
        submap,
        clusters,
        guesses,
        result,
        information,
        reach_rad=math.radians(min(180.0, recovery.reach_deg * wider)),
        sigma_m=sigma_m,
        odometry=predicted if growing and prediction.by_odometry else None,
        recovery=recovery,
        registration=settings.registration,
    )
