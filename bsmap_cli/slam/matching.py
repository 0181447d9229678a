"""Where a scan lies on a submap: register down the ladder, and search where that fails."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.slam.ladder import track_down
from bsmap_cli.slam.prediction import Prediction
from bsmap_cli.slam.recovery import recover
from bsmap_cli.slam.registration import RegistrationResult
from bsmap_cli.slam.submap import Submap

if TYPE_CHECKING:
    from bsmap_cli.slam.slam_settings import SlamSettings

ASTRAY_RAD = 0.05  # angles searched where only the way along a corridor is in doubt
FEWEST_POINTS = 10  # a scan with fewer says nothing about being lost


def share_enough(explained: float, settings: SlamSettings) -> float:
    """Share of a scan's points that must lie on the finest level to leave it at that.

    explained : share of the last scan's. Of new ground less lies on the map, from any pose: what
    the last scan had on it is the measure.
    """
    return max(settings.registration.shortcut * explained, settings.recovery.search_below)


def match_scan(
    submap: Submap,
    clusters: Sequence[Clusters],
    last: SE2,
    prediction: Prediction,
    *,
    blind: float,
    explained: float,
    growing: bool = True,
    finest: RegistrationResult | None = None,
    sigma_m: float,
    settings: SlamSettings,
) -> RegistrationResult:
    """Register the scan that follows the one at `last`, a pose in the submap's frame.

    blind : usual scan times that passed without odometry; in a gap the robot may have gone
    anywhere near, and even a fair match may be of another place.
    explained : share of the last scan's points that lay on the map.
    growing : the map ends where the robot has been, and not where the walls do.
    finest : the match on the finest level, where it has been made.

    A corridor holds its few features out of reach as soon as the robot starts, stops or turns
    otherwise than predicted: what is left then looks bare, and the prediction is kept. Where
    points find no wall while one direction is unobserved and no wheels speak, a search looks
    along the corridor; only what shows the way in all directions is believed.
    """
    predicted = (last @ SE2(*prediction.step)).as_array()
    information = prediction.information()
    recovery = settings.recovery
    result = track_down(
        submap.levels,
        clusters,
        predicted,
        predicted,
        information,
        enough=share_enough(explained, settings),
        finest=finest,
        sigma_m=sigma_m,
        settings=settings,
    )
    gap = blind > recovery.gap
    fair = result.inlier_ratio >= recovery.search_below
    adrift = result.degenerate > 0 and not prediction.by_odometry
    unexplained = (1.0 - result.inlier_ratio) * result.points
    astray = adrift and unexplained >= settings.segmentation.faint_points
    if (fair and not gap and not astray) or result.points < FEWEST_POINTS:
        return result
    wider = min(blind, recovery.widest) if gap else 1.0
    reach_m = recovery.reach * settings.ladder[-1] * wider
    believed = information if growing and prediction.by_odometry else None
    if not prediction.by_odometry and (gap or astray):
        believed = np.diag([(0.5 * reach_m) ** -2.0] * 2 + [0.0])
    reach_rad = math.radians(min(180.0, recovery.reach_deg * wider))
    way = math.hypot(*prediction.step[:2])
    guesses = [(predicted, reach_m + 0.5 * way), (last.as_array(), reach_m + way)]
    if fair and not gap:  # the walls that are seen hold the heading
        guesses, reach_rad = guesses[:1], ASTRAY_RAD
    return recover(
        submap,
        clusters,
        guesses,
        result,
        information,
        reach_rad=reach_rad,
        sigma_m=sigma_m,
        surely=adrift,
        believed=believed,
        recovery=recovery,
        registration=settings.registration,
    )
