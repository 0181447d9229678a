"""Loop closure: does this keyframe see a place that an old submap holds?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.mapping.scan_levels import ScanLevels
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.settings import setting
from bsmap_cli.slam.ladder import register_down
from bsmap_cli.slam.likelihood import Likelihood
from bsmap_cli.slam.loop_tasks import LoopTask, Place
from bsmap_cli.slam.recovery import CELL_STEPS
from bsmap_cli.slam.registration import RegistrationResult
from bsmap_cli.slam.search_window import Window, heights_for
from bsmap_cli.slam.submap import Submap
from bsmap_cli.slam.submap_graph import SubmapGraph
from bsmap_cli.slam.uncertainty import isotropic_information, match_information
from bsmap_cli.slam.viewpoints import Viewpoints, median_range
from bsmap_cli.slam.wide_search import search

if TYPE_CHECKING:
    from bsmap_cli.slam.slam_settings import SlamSettings

LEAST_HEIGHTS, HEIGHTS = 5, 6  # of a likelihood pyramid: blocks of 16 or 32 cells at the top
DRAWN = 32  # likelihoods of submaps that are kept for the next search
OPEN = 48  # submaps that stay open for the next registration
DIRECT_STEPS = 3.0  # up to this uncertainty the ladder alone finds a place
REFINED = 2  # levels, from the finest up, that draw in what a search leaves: less than its cell
WIDE_STEPS = 200.0  # from this reach on deviations count as those of a long way
LEAST_SCORE, LEAST_WIDE_SCORE = 0.4, 0.5  # of a place worth refining; right ones mostly have 0.7
RETRY_SHARE = 0.05  # of its reach: way before a search is worth repeating
KEPT = 0.83  # of what a scan had on the map it was tracked on; less: a place that is only like it
AGREED_STEPS = 2.0  # two closures from far off may contradict one another by so much
URGENT_STEPS = 2.0  # a closure that moves the map by more is taken in before the next search


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopSettings:
    """When a place counts as found again."""

    enabled: bool = setting(True, "look for loops at all")
    min_inliers: float = setting(
        0.7, "share of the scan that must lie on the old submap", minimum=0.0, maximum=1.0
    )
    max_rms: float = setting(0.5, "of the inliers' residuals [finest knot steps]", minimum=0.0)
    max_reach: float = setting(1000.0, "widest search, half width [finest knot steps]", minimum=0.0)
    deviations: float = setting(
        3.0, "a search reaches so many deviations of the graph's uncertainty", minimum=0.0
    )
    uniqueness: float = setting(
        1.1, "the best place must score so many times the best place elsewhere", minimum=1.0
    )
    tries: int = setting(
        2, "most searches for one keyframe; all keyframes together have one each", minimum=1
    )
    retry: float = setting(
        10.0, "way before a submap is searched again [finest knot steps]", minimum=0.0
    )


@dataclass(frozen=True, slots=True)
class Loop:
    """Keyframe seen from a submap: (3,) pose in its frame; information in the same frame."""

    submap: int
    keyframe: int
    pose_submap_base: SE2
    information: Points


class LoopCloser:
    """Looks for loops, keyframe by keyframe, and tells the submap graph."""

    def __init__(self, settings: SlamSettings) -> None:
        self.graph = SubmapGraph(settings.ladder[-1])
        self.loops: list[Loop] = []
        self.tried = 0
        self.settings = settings
        self._refining = settings.registration.far_off()
        self._places: list[Place] = []
        self._submaps: list[Submap] = []
        self._viewpoints = Viewpoints()
        self._next_try = np.empty(0)
        self._travelled_m = 0.0
        self._doubtful: list[tuple[Loop, SE2]] = []
        self._drawn: dict[int, Submap] = {}
        self._open: dict[int, Submap] = {}

    def process(self, task: LoopTask) -> None:
        """Search the nearby old submaps for one keyframe."""
        place, settings = task.place, self.settings
        if self._places:
            step = place.pose_local.relative_to(self._places[-1].pose_local)
            self._travelled_m += math.hypot(step.x, step.y)
        self._places.append(place)
        self._remember(task.finished)
        self.graph.update(task.links)
        view_m = median_range(task.clusters.points)
        here = self.graph.pose(place.submap) @ place.pose_submap_base
        candidates = self._candidates(place, view_m, here)
        if not candidates:
            return
        finest = task.clusters.unpack(settings.ladder[-1], task.sigma_m)
        clusters = ScanLevels(finest, settings.ladder, settings.fitting, task.sigma_m)
        for submap, reach_m, reach_rad in candidates:
            guess = here.relative_to(self.graph.pose(submap.index)).as_array()
            window = Window(guess, reach_m, reach_rad)
            loop = self._try(place, clusters, submap, window, task.sigma_m)
            if loop is None:
                continue
            if reach_m > 10.0 * settings.ladder[-1]:
                self._confirm(loop, view_m)
            else:
                self._accept(loop)

    def _candidates(
        self, place: Place, view_m: float, here: SE2
    ) -> list[tuple[Submap, float, float]]:
        """The finished submaps that most likely see what the keyframe sees, nearest first."""
        unit, settings, count = self.settings.ladder[-1], self.settings.loops, len(self._submaps)
        # round and round the same way ever more submaps hold the place: the nearest will do
        most = min(settings.tries, place.keyframe - self.tried)
        if count == 0 or most <= 0:
            return []
        metres, radians = self.graph.deviations_from(place.submap)
        reach_m = np.minimum(settings.deviations * metres[:count], settings.max_reach * unit)
        nearest = self._nearest(here, view_m, reach_m, most)
        wide_m = WIDE_STEPS * unit
        if any(reach_m[k] > wide_m for k in nearest):
            far_m = self.graph.far_deviations_from(place.submap)[:count]
            reach_m = np.minimum(reach_m, np.maximum(settings.deviations * far_m, wide_m))
            nearest = self._nearest(here, view_m, reach_m, most)
        return [
            (self._submaps[k], float(reach_m[k]), settings.deviations * float(radians[k]))
            for k in nearest
        ]

    def _nearest(self, here: SE2, view_m: float, reach_m: Vector, most: int) -> list[int]:
        return self._viewpoints.nearest(
            self.graph.poses,
            here,
            view_m,
            reach_m,
            next_try_m=self._next_try,
            travelled_m=self._travelled_m,
            most=most,
        )

    def _remember(self, finished: Sequence[Submap]) -> None:
        """Keep where finished submaps were seen from, and when each may be tried."""
        for submap in finished:
            self._submaps.append(submap)
            self._next_try = np.append(self._next_try, 0.0 if submap.keyframes else math.inf)
            self._viewpoints.add(submap)

    def _try(
        self,
        place: Place,
        clusters: Sequence[Clusters],
        submap: Submap,
        window: Window,
        sigma_m: float,
    ) -> Loop | None:
        """Search, refine, judge."""
        settings = self.settings
        unit, reach_m = settings.ladder[-1], window.reach_m
        self.tried += 1
        # the wider the search, the more submaps wait for theirs, and the longer a loop may take
        again_m = max(settings.loops.retry * unit, RETRY_SHARE * reach_m)
        self._next_try[submap.index] = self._travelled_m + again_m
        folded = _oldest(self._open, submap, OPEN)
        if folded:
            folded.fold()
        coarse = clusters[max(0, len(clusters) - 2)]
        likelihood = self._likelihood(submap, window)
        floor = LEAST_WIDE_SCORE if reach_m > WIDE_STEPS * unit else LEAST_SCORE
        peak = search(likelihood, coarse.points, coarse.tangents, window, floor=floor)
        if peak is None:
            return None
        result = register_down(
            submap.levels[-REFINED:],
            clusters[-REFINED:],
            peak.pose,
            peak.pose,
            isotropic_information((0.5 * DIRECT_STEPS * unit, 0.1)),
            sigma_m=sigma_m,
            settings=self._refining,
        )
        if not self._good(result, unit) or result.inlier_ratio < KEPT * place.explained:
            return None
        # most places fail above: where else the scan may be is asked of those that fit
        rival = search(
            likelihood,
            coarse.points,
            coarse.tangents,
            window,
            floor=peak.score / settings.loops.uniqueness,
            barred=peak,
            apart_m=10.0 * unit,
        )
        if rival is not None:
            return None
        self._next_try[submap.index] = self._travelled_m + 3.0 * settings.loops.retry * unit
        information = match_information(result.information, unit)
        return Loop(submap.index, place.keyframe, SE2.from_array(result.pose), information)

    def _likelihood(self, submap: Submap, window: Window) -> Likelihood:
        """What a search in that window looks at; drawn anew where it is not of the last ones."""
        forgotten = _oldest(self._drawn, submap, DRAWN)
        if forgotten:
            forgotten.forget_likelihood()
        cell_m = CELL_STEPS * self.settings.ladder[-1]
        heights = max(LEAST_HEIGHTS, heights_for(math.ceil(window.reach_m / cell_m)))
        return submap.likelihood(cell_m=cell_m, heights=min(HEIGHTS, heights))

    def _good(self, result: RegistrationResult, unit_m: float) -> bool:
        settings = self.settings.loops
        return (
            result.points >= 10
            and result.inlier_ratio >= settings.min_inliers
            and result.rms_m <= settings.max_rms * unit_m
        )

    def _accept(self, loop: Loop) -> None:
        self.loops.append(loop)
        place = self._places[loop.keyframe]
        pose_submap_submap = loop.pose_submap_base @ place.pose_submap_base.inverse()
        expected = self.graph.pose(loop.submap).inverse() @ self.graph.pose(place.submap)
        gap = expected.inverse() @ pose_submap_submap
        self.graph.add_loop(
            loop.submap,
            place.submap,
            pose_submap_submap,
            loop.information,
            urgent=math.hypot(gap.x, gap.y) > URGENT_STEPS * self.settings.ladder[-1],
        )

    def _confirm(self, loop: Loop, view_m: float) -> None:
        """A closure from far off waits for one that asks for the same correction of this place.

        That is evidence only where each could have asked for another one: both must know the
        place in all directions, and the second not see again what misled the first.
        """
        unit = self.settings.ladder[-1]
        if _position_deviation(loop.information) > AGREED_STEPS * unit:
            return
        wanted = self.graph.pose(loop.submap) @ loop.pose_submap_base
        for other, other_wanted in self._doubtful:
            if other.keyframe == loop.keyframe:
                continue
            before = self._places[other.keyframe].pose_local
            tracked = before.inverse() @ self._places[loop.keyframe].pose_local
            asked = other_wanted.inverse() @ wanted
            gap = tracked.inverse() @ asked
            way = math.hypot(tracked.x, tracked.y)
            if (
                math.hypot(gap.x, gap.y) < AGREED_STEPS * unit + min(0.05 * way, 5.0 * unit)
                and abs(gap.theta) < math.radians(3.0)
                and view_m <= way < max(100.0 * unit, 2.0 * view_m)
            ):
                self._doubtful.remove((other, other_wanted))
                self._accept(other)
                self._accept(loop)
                return
        self._doubtful.append((loop, wanted))
        del self._doubtful[:-50]


def _oldest(kept: dict[int, Submap], asked: Submap, most: int) -> Submap | None:
    """Note which submaps were asked for last, `most` of them; the one that this drives out."""
    kept.pop(asked.index, None)
    kept[asked.index] = asked
    return kept.pop(next(iter(kept))) if len(kept) > most else None


def _position_deviation(information: Points) -> float:
    """Of a pose [m], along the direction in which it is known the least."""
    covariance = np.linalg.inv(information)[:2, :2]
    return math.sqrt(float(np.linalg.eigvalsh(covariance)[-1]))
