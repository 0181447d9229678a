"""Where stretches of a log's keyframes lie in an old map, and what speaks for each place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from bsmap_cli.errors import TrackingError
from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.mapping.scan_levels import ScanLevels
from bsmap_cli.mapping.visibility import HIT, MISS, look_at
from bsmap_cli.slam.known_map import MOST_POINTS, KnownMap
from bsmap_cli.slam.ladder import register_down
from bsmap_cli.slam.likelihood import sample_surfaces
from bsmap_cli.slam.local_slam import LocalSlam
from bsmap_cli.slam.loop_closure import DIRECT_STEPS, HEIGHTS
from bsmap_cli.slam.matching import FEWEST_POINTS
from bsmap_cli.slam.recovery import CELL_STEPS
from bsmap_cli.slam.registration import RegistrationResult
from bsmap_cli.slam.search_window import Peak, Window
from bsmap_cli.slam.uncertainty import isotropic_information
from bsmap_cli.slam.wide_search import search

LENGTHS, APART = (40, 10), 20  # keyframes of a stretch, and from the start of one to the next
SEARCHED = 24  # stretches, spread over the log, that are searched for first
ENOUGH = 5  # places that agree, and none that does not: no more is searched for
AGREEING = 0.75  # share of a stretch's keyframes that must fit the place found for it
LEAST_SCORE = 0.65  # of a stretch that may lie at a place
RIVAL = 1.25  # a place elsewhere that scores worse by more is none
BETTER = 1.05  # share of points on old curves, as many times that at the rival
FEWEST = 3  # keyframes of a stretch; and what must speak for a place
APART_STEPS, APART_SHARE = 10.0, 0.05  # two places agree: finest knot steps, of the way between
JUDGED_STEPS = 300.0  # way from a place on which keyframes are asked [finest knot steps]
# share of the old spans in view that a keyframe looks through: by chance; where it is misplaced
MISSED, MISPLACED = 0.02, 0.1
# without that: share of its points by old curves, and not on them [finest knot steps]
ON_STEPS, NEAR_STEPS, BESIDE_SHARE = 0.75, 10.0, 0.3

NO_PLACE = (
    "the log has no place in the old map, or more than one: is it a log of that place, and long "
    "enough to tell? Without --map it gets a map of its own; `bsmap merge --at` joins two maps"
)


@dataclass(slots=True)
class Place:
    """A stretch of keyframes found in the old map: where its first one lies.

    witnesses : keyframes that fit; share : of their points that lie on old curves, in the mean
    over the whole stretch; told : what all keyframes round it say for it.
    """

    stretch: range
    pose_map_base: SE2
    witnesses: int
    share: float
    told: float = 0.0


class PlaceFinder:
    """Searches an old map for the keyframes of a finished run.

    way_m : (n,) way from the first keyframe to each [m].
    """

    def __init__(self, known: KnownMap, local: LocalSlam) -> None:
        from scipy.spatial import cKDTree

        self._known, self._local = known, local
        self._settings = local.settings
        self._unit = local.settings.ladder[-1]
        self._tree = cKDTree(sample_surfaces(known.levels[-1], self._unit)[0])
        places = np.array([[frame.pose_local.x, frame.pose_local.y] for frame in local.keyframes])
        steps = np.hypot(*np.diff(places, axis=0).T)
        self.way_m: Vector = np.concatenate(([0.0], np.cumsum(steps)))

    def find(self, poses: Points) -> tuple[range, SE2]:
        """The stretch that tells best where the log lies, and the log's frame in the old map.

        poses : (n, 3) of the keyframes in the log's frame. TrackingError where no place fits, or
        more than one.
        """
        places: list[Place] = []
        for number, stretch in enumerate(self._stretches()):
            of_one_mind = all(self._agree(places[0], place, poses) for place in places)
            if places and (number >= SEARCHED or (of_one_mind and len(places) >= ENOUGH)):
                break
            place = self._place(stretch)
            if place is not None:
                places.append(place)
        for place in places:
            place.told = self._told(place, poses)
        best = max(places, key=lambda place: place.told, default=None)
        if best is None or best.told < FEWEST:
            raise TrackingError(NO_PLACE)
        for place in places:
            if 2.0 * place.told > best.told and not self._agree(best, place, poses):
                raise TrackingError(NO_PLACE)
        return best.stretch, self._frame(best, poses)

    def place_near(
        self, stretch: range, centre: Vector, reach_m: float, reach_rad: float
    ) -> Place | None:
        """A stretch's place within reach of where it should be, if one alone fits."""
        points, tangents = self._surfaces(stretch)
        if len(points) < FEWEST_POINTS:
            return None
        likelihood = self._known.likelihood(cell_m=CELL_STEPS * self._unit, heights=HEIGHTS)
        window = Window(centre, reach_m, reach_rad)
        peak = search(likelihood, points, tangents, window, floor=AGREEING)
        if peak is None:
            return None
        rival = search(
            likelihood,
            points,
            tangents,
            window,
            floor=peak.score / RIVAL,
            barred=peak,
            apart_m=10.0 * self._unit,
        )
        peaks = [peak] if rival is None else [peak, rival]
        return self._only([self._verified(stretch, peak) for peak in peaks])

    def registered(self, k: int, start: Vector) -> RegistrationResult:
        """A keyframe registered on the old map from (3,) `start`."""
        settings, sigma_m = self._settings, self._local.sigma_m
        finest = self._local.keyframes[k].clusters.unpack(self._unit, sigma_m)
        return register_down(
            self._known.levels,
            ScanLevels(finest, settings.ladder, settings.fitting, sigma_m),
            start,
            start,
            isotropic_information((0.5 * DIRECT_STEPS * self._unit, 0.1)),
            sigma_m=sigma_m,
            settings=settings.registration.far_off(),
        )

    def fits(self, result: RegistrationResult) -> bool:
        """Does a keyframe lie on the old map where it was registered?"""
        return (
            result.points >= FEWEST_POINTS
            and result.inlier_ratio >= self._settings.loops.min_inliers
            and result.rms_m <= self._settings.loops.max_rms * self._unit
        )

    def _stretches(self) -> list[range]:
        """Stretches of keyframes, long ones and short ones, far apart ones first."""
        count = len(self._local.keyframes)
        found = []
        for length in LENGTHS:
            first = [range(k, min(k + length, count)) for k in range(0, count, APART)]
            found += [stretch for stretch in first if len(stretch) >= FEWEST] or first
        every = max(1, math.ceil(len(found) / SEARCHED))
        return [stretch for k in range(every) for stretch in found[k::every]]

    def _place(self, stretch: range) -> Place | None:
        """The one place in the whole old map where a stretch fits, with most of its keyframes."""
        points, tangents = self._surfaces(stretch)
        if len(points) < FEWEST_POINTS:
            return None
        peaks = self._known.places(points, tangents, worse=RIVAL, least=LEAST_SCORE)
        found = [self._verified(stretch, peak) for peak in peaks]
        return self._only(found)

    def _only(self, found: list[Place | None]) -> Place | None:
        """The place that fits, where there is one that fits clearly better than all others."""
        places = sorted((place for place in found if place), key=lambda place: -place.share)
        if len(places) > 1 and places[0].share < BETTER * places[1].share:
            return None
        return places[0] if places else None

    def _surfaces(self, stretch: range) -> tuple[Points, Points]:
        """What a stretch saw: (n, 2) points and tangents in the frame of its first keyframe."""
        points, tangents = [np.zeros((0, 2))], [np.zeros((0, 2))]
        first = self._local.keyframes[stretch[0]].pose_local.inverse()
        for k in stretch:
            frame = self._local.keyframes[k]
            pose = first @ frame.pose_local
            clusters = frame.clusters.unpack(self._unit, self._local.sigma_m)
            points.append(pose.transform(clusters.points))
            tangents.append(SE2(0.0, 0.0, pose.theta).transform(clusters.tangents))
        every = max(1, math.ceil(sum(len(part) for part in points) / MOST_POINTS))
        return np.concatenate(points)[::every], np.concatenate(tangents)[::every]

    def _verified(self, stretch: range, peak: Peak) -> Place | None:
        """The place as the stretch's own keyframes refine it, if they fit."""
        first = self._local.keyframes[stretch[0]].pose_local.inverse()
        found, share = [], 0.0
        for k in stretch:
            step = first @ self._local.keyframes[k].pose_local
            result = self.registered(k, (SE2.from_array(peak.pose) @ step).as_array())
            if self.fits(result):
                found.append(SE2.from_array(result.pose) @ step.inverse())
                share += result.inlier_ratio / len(stretch)
        if len(found) < max(AGREEING * len(stretch), 1):
            return None
        return Place(stretch, found[len(found) // 2], len(found), share)

    def _frame(self, place: Place, poses: Points) -> SE2:
        """The log's frame in the old map, as one place has it."""
        return place.pose_map_base @ SE2.from_array(poses[place.stretch[0]]).inverse()

    def _agree(self, one: Place, other: Place, poses: Points) -> bool:
        """Do two places put the other's stretch within what drift explains?"""
        i, k = one.stretch[0], other.stretch[0]
        step = SE2.from_array(poses[i]).inverse() @ SE2.from_array(poses[k])
        gap = (one.pose_map_base @ step).inverse() @ other.pose_map_base
        way_m = abs(float(self.way_m[k] - self.way_m[i]))
        return math.hypot(gap.x, gap.y) <= APART_STEPS * self._unit + APART_SHARE * way_m

    def _told(self, place: Place, poses: Points) -> float:
        """What the keyframes near a place say for it, less what those say that contradict it.

        Outwards from the place keyframe follows keyframe, each beginning where the last one that
        fits has put the log: drift does not count. One that fits counts by how much of it lies
        on old curves; one that lies by old curves and does not fit is against it.
        """
        told = 0.0
        first, count = place.stretch[0], len(self._local.keyframes)
        for way in (range(first, count), range(first - 1, -1, -1)):
            frame = self._frame(place, poses)
            for k in way:
                if abs(float(self.way_m[k] - self.way_m[first])) > JUDGED_STEPS * self._unit:
                    break
                said, frame = self._said(k, SE2.from_array(poses[k]), frame)
                told += said
        return told

    def _said(self, k: int, pose: SE2, pose_map_log: SE2) -> tuple[float, SE2]:
        """What one keyframe, at a pose in the log, says for a place; where it puts the log."""
        start = pose_map_log @ pose
        result = self.registered(k, start.as_array())
        if not self.fits(result):
            return -self._contradiction(k, start), pose_map_log
        found = SE2.from_array(result.pose)
        least = self._settings.loops.min_inliers
        said = (result.inlier_ratio - least) / (1.0 - least) - self._contradiction(k, found)
        return said, found @ pose.inverse()

    def _contradiction(self, k: int, pose_map_base: SE2) -> float:
        """How much a keyframe speaks against a place, 0 to 1: it looks through old curves there.

        Where nothing is known of what it looks through, all that fit badly speak against it.
        """
        frame = self._local.keyframes[k]
        if frame.sight is not None:
            pose, sigma_m = pose_map_base.as_array(), self._local.sigma_m
            look = look_at(self._known.levels[-1], frame.sight, pose, sigma_m)
            hits, misses = int((look.verdicts == HIT).sum()), int((look.verdicts == MISS).sum())
            share = misses / max(misses + hits, FEWEST_POINTS)
            return min(1.0, max(0.0, (share - MISSED) / (MISPLACED - MISSED)))
        seen = pose_map_base.transform(frame.clusters.points[::4].astype(np.float64))
        if not len(seen):
            return 0.0
        distance = self._tree.query(seen)[0]
        beside = (distance > ON_STEPS * self._unit) & (distance < NEAR_STEPS * self._unit)
        return float(np.mean(beside) >= BESIDE_SHARE)
