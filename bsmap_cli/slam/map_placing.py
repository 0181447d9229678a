"""Where one map lies in another: searched for in parts, refined as a whole, judged by overlap.

Parts of the second map are searched for in the whole first one, all positions and headings. Each
place found is refined by registering all of the second map's curves on those of the first, and
judged by what lies on one another, less what lies side by side and differs.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.errors import MapFileError
from bsmap_cli.geometry.se2 import SE2, Points, Vector
from bsmap_cli.mapping.map_document import LevelSamples, MapDocument
from bsmap_cli.mapping.resampling import one_level
from bsmap_cli.mapping.sampling import sample_level
from bsmap_cli.mapping.scan_levels import ScanLevels
from bsmap_cli.mapping.segmentation import Clusters
from bsmap_cli.slam.known_map import MOST_POINTS, KnownMap, settings_for_map
from bsmap_cli.slam.ladder import register_down
from bsmap_cli.slam.likelihood import sample_surfaces
from bsmap_cli.slam.recovery import CELL_STEPS
from bsmap_cli.slam.search_window import Window
from bsmap_cli.slam.slam_settings import SlamSettings
from bsmap_cli.slam.uncertainty import isotropic_information
from bsmap_cli.slam.wide_search import search

SAMPLES_PER_STEP = 2
RADII_STEPS = (300.0, 150.0, 60.0)  # of the parts that are searched for [finest knot steps]
PARTS = 8  # of each radius
ENOUGH, CLEAR = 3, 2.0  # parts of one place that tells so many times as much as any other
RIVAL = 1.25  # a place elsewhere that scores worse by more is none
ON_STEPS, ON_COSINE = 0.75, 0.866  # curves lie on one another [finest knot steps], 30 degrees
NEAR_STEPS = 10.0  # so near, they should [finest knot steps]
DIFFERING = 2.0  # what does not, but is as near, counts so many times against a place
LEAST_STEPS = 30.0  # of overlap, less what differs [finest knot steps]
SAME_STEPS, SAME_RAD = 5.0, 0.1  # two places are one [finest knot steps]
GUESS_STEPS, GUESS_RAD = 20.0, 0.35  # that a pose given by hand may be off
ROUNDS = 3  # of registration: each begins where the last one ended


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """Map B in the frame of map A.

    overlap_m : of B's curves on those of A; aside_m : of them near those of A, but not on them;
    refined : not just the pose that was given.
    """

    pose_a_b: SE2
    overlap_m: float
    aside_m: float
    refined: bool


@dataclass(slots=True)
class _Found:
    """A place of the middle of B's curves."""

    pose: SE2
    overlap_m: float
    aside_m: float
    told_m: float
    votes: int = 0


class MapPlacer:
    """Finds the places of one map, B, in another, A.

    MapFileError where one of them draws nothing.
    """

    def __init__(self, a: MapDocument, b: MapDocument, settings: SlamSettings) -> None:
        from scipy.spatial import cKDTree

        self._settings = settings_for_map(settings, a)
        self._unit = self._settings.ladder[-1]
        self._known = KnownMap(a, self._settings)
        self._samples = sample_level(one_level(b), self._unit / SAMPLES_PER_STEP)
        if not len(self._samples.points):
            raise MapFileError("the second map draws no curve: there is nothing to place")
        self._shares_m = _shares(self._samples)
        # B is turned about the middle of its curves, wherever its origin lies
        low, high = self._samples.points.min(axis=0), self._samples.points.max(axis=0)
        x, y = (0.5 * (low + high)).tolist()
        self._pose_b_middle = SE2(x, y, 0.0)
        self._samples = replace(self._samples, points=self._samples.points - [x, y])
        self._clusters = ScanLevels(
            _as_clusters(self._samples),
            self._settings.ladder,
            self._settings.fitting,
            sigma_m=0.0,
        )
        self._old_points, self._old_tangents = sample_surfaces(
            self._known.levels[-1], self._unit / SAMPLES_PER_STEP
        )
        self._tree = cKDTree(self._old_points)

    def search(self) -> Placement | None:
        """The one place that fits; None where there is none, or more than one."""
        found: list[_Found] = []
        for rows in self._parts():
            for pose in self._candidates(rows):
                place = self._known_place(found, pose) or self._refined(pose)
                place = self._known_place(found, place.pose) or place
                place.votes += 1
                if place.votes == 1:
                    found.append(place)
            found.sort(key=lambda place: -place.told_m)
            if found and found[0].votes >= ENOUGH and self._best(found, CLEAR):
                break
        best = self._best(found, self._settings.loops.uniqueness)
        return self._placement(best) if best else None

    def _best(self, found: list[_Found], times: float) -> _Found | None:
        """The first place, if it is one and tells so many times as much as the second."""
        if not found or found[0].told_m < LEAST_STEPS * self._unit:
            return None
        unique = len(found) == 1 or found[0].told_m >= times * found[1].told_m
        return found[0] if unique else None

    def _known_place(self, found: list[_Found], pose: SE2) -> _Found | None:
        return next((place for place in found if self._same(place.pose, pose)), None)

    def near(self, guess: SE2) -> Placement:
        """The place next to a pose given by hand; that pose itself where nothing overlaps."""
        guess = guess @ self._pose_b_middle
        found = [self._refined(guess)]
        points = guess.transform(self._samples.points)
        close = self._tree.query(points)[0] < GUESS_STEPS * self._unit
        rows = np.flatnonzero(close)
        if len(rows):
            rows = rows[:: max(1, math.ceil(len(rows) / MOST_POINTS))]
            likelihood = self._known.likelihood(cell_m=CELL_STEPS * self._unit, heights=6)
            centre = points[rows].mean(axis=0)
            turned = SE2(0.0, 0.0, guess.theta).transform(self._samples.tangents[rows])
            window = Window(
                np.array([centre[0], centre[1], 0.0]), GUESS_STEPS * self._unit, GUESS_RAD
            )
            peak = search(likelihood, points[rows] - centre, turned, window, floor=0.3)
            if peak is not None:
                moved = SE2.from_array(peak.pose) @ SE2(-centre[0], -centre[1], 0.0)
                found.append(self._refined(moved @ guess))
        best = max(found, key=lambda place: place.overlap_m)
        given = self._judged(guess)
        if best.overlap_m < max(LEAST_STEPS * self._unit, given.overlap_m):
            return self._placement(given, refined=False)
        return self._placement(best)

    def _placement(self, found: _Found, *, refined: bool = True) -> Placement:
        return Placement(
            pose_a_b=found.pose @ self._pose_b_middle.inverse(),
            overlap_m=found.overlap_m,
            aside_m=found.aside_m,
            refined=refined,
        )

    def _parts(self) -> Iterator[NDArray[np.int64]]:
        """Rows of B's samples round spread centres, large parts first; each part once."""
        points = self._samples.points
        largest = float(np.hypot(*points.T).max())
        centres = _spread(points, PARTS)
        whole = False
        for radius in RADII_STEPS:
            radius_m = radius * self._unit
            if largest <= radius_m:
                if not whole:
                    whole = True
                    yield np.arange(len(points))
                continue
            for centre in centres:
                rows = np.flatnonzero(np.hypot(*(points - points[centre]).T) <= radius_m)
                if len(rows) < len(points):
                    yield rows

    def _candidates(self, rows: NDArray[np.int64]) -> list[SE2]:
        """Poses of B in A at which a part of B fits best."""
        points = self._samples.points[rows]
        centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
        peaks = self._known.places(points - centre, self._samples.tangents[rows], worse=RIVAL)
        back = SE2(-float(centre[0]), -float(centre[1]), 0.0)
        return [SE2.from_array(peak.pose) @ back for peak in peaks]

    def _refined(self, pose: SE2) -> _Found:
        """All of B registered on A, from one pose."""
        for _ in range(ROUNDS):
            start = pose.as_array()
            result = register_down(
                self._known.levels,
                self._clusters,
                start,
                start,
                isotropic_information((5.0 * self._unit, 0.5)),
                sigma_m=0.0,
                settings=self._settings.registration.far_off(),
            )
            pose = SE2.from_array(result.pose)
        found = self._judged(pose)
        if result.degenerate:
            found.told_m = 0.0
        return found

    def _judged(self, pose: SE2) -> _Found:
        """What of B lies on A's curves, and what a place tells: less what lies side by side."""
        from scipy.spatial import cKDTree

        turn = SE2(0.0, 0.0, pose.theta)
        points = pose.transform(self._samples.points)
        tangents = turn.transform(self._samples.tangents)
        spacing_m = self._unit / SAMPLES_PER_STEP
        on, near = self._met(self._tree, self._old_tangents, points, tangents)
        old_on, old_near = self._met(
            cKDTree(points), tangents, self._old_points, self._old_tangents
        )
        told = [
            float(met.sum() - DIFFERING * (close & ~met).sum())
            for met, close in ((on, near), (old_on, old_near))
        ]
        overlap_m, aside_m = (float(self._shares_m[met].sum()) for met in (on, near & ~on))
        return _Found(pose, overlap_m, aside_m, spacing_m * min(told))

    def _met(
        self, tree: object, there: Points, points: Points, tangents: Points
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which points lie on the curves of a tree, and which lie near them at all."""
        distance, row = tree.query(points, k=[1, 2, 3, 4])  # type: ignore[attr-defined]
        row = np.minimum(row, len(there) - 1)
        along = np.einsum("nki,ni->nk", there[row], tangents)
        on = (distance <= ON_STEPS * self._unit) & (along >= ON_COSINE)
        near: NDArray[np.bool_] = distance[:, 0] <= NEAR_STEPS * self._unit
        return on.any(axis=1), near

    def _same(self, one: SE2, other: SE2) -> bool:
        """Do two poses put B's curves at the same place?"""
        apart = math.hypot(one.x - other.x, one.y - other.y)
        turn = abs(math.remainder(one.theta - other.theta, math.tau))
        return apart <= SAME_STEPS * self._unit and turn <= SAME_RAD


def _shares(samples: LevelSamples) -> Vector:
    """(n,) metres of a map's curves that each sample stands for: halfway to its neighbours."""
    ways = np.hypot(*np.diff(samples.points, axis=0).T)
    ways[np.diff(samples.piece) != 0] = 0.0
    shares: Vector = 0.5 * (np.append(ways, 0.0) + np.append(0.0, ways))
    return shares


def _as_clusters(samples: LevelSamples) -> Clusters:
    """Every drawn piece as one cluster of a scan."""
    starts = np.flatnonzero(np.diff(samples.piece, prepend=-1, append=-2))
    counts: Vector = np.ones(len(samples.points))
    return Clusters(samples.points, samples.tangents, counts, starts.astype(np.int64))


def _spread(points: Points, count: int) -> list[int]:
    """Rows of points far apart from each other: each is the farthest from those before it."""
    middle = points.mean(axis=0)
    rows = [int(np.argmin(np.hypot(*(points - middle).T)))]
    distance = np.hypot(*(points - points[rows[0]]).T)
    while len(rows) < min(count, len(points)):
        rows.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.hypot(*(points - points[rows[-1]]).T))
    return rows
