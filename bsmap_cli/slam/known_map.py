"""A finished map as a submap: matched against, and searched as a whole."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np

from bsmap_cli.errors import MapFileError
from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.mapping.mapping_settings import MappingSettings
from bsmap_cli.mapping.resampling import one_level, resampled_level
from bsmap_cli.mapping.thaw import thaw_level
from bsmap_cli.slam.likelihood import Likelihood, build_likelihood, sample_surfaces
from bsmap_cli.slam.search_window import Peak, Window
from bsmap_cli.slam.submap import Submap
from bsmap_cli.slam.wide_search import search

Part = TypeVar("Part", bound=MappingSettings)

HEIGHTS = 6  # of the likelihood pyramid: blocks of 32 cells at the top
MOST_CELLS = 1.5e7  # of the likelihood; the cells of larger maps are wider
MOST_POINTS = 200  # that a search places on the map
MARGIN_STEPS = 20.0  # how far outside of all curves the robot may stand [finest knot steps]
LEAST_SCORE = 0.5  # of a place that may be right: much may have changed since


class KnownMap(Submap):
    """The curves of a map in its own frame, one level for each knot step of the ladder.

    Levels that the map does not hold are derived from its finest one. frozen : the levels as
    they are; `levels` are matched against.
    """

    def __init__(self, document: MapDocument, settings: MappingSettings) -> None:
        super().__init__(0, SE2.identity(), settings)
        finest = one_level(document)
        self.frozen = [resampled_level(finest, step) for step in settings.ladder[:-1]]
        self.frozen.append(finest)
        self.levels = [thaw_level(level) for level in self.frozen]
        points, _ = sample_surfaces(self.levels[-1], self.levels[-1].knot_step_m)
        if not len(points):
            raise MapFileError("the map draws no curve: there is nothing to find a scan on")
        self._low, self._high = points.min(axis=0), points.max(axis=0)
        self._grid: Likelihood | None = None

    def likelihood(self, *, cell_m: float, heights: int) -> Likelihood:
        """What searches look at; cells may be wider and the pyramid higher than asked for."""
        if self._grid is None:
            area = float(np.prod(self._high - self._low + cell_m))
            cell_m *= max(1.0, math.sqrt(area / MOST_CELLS) / cell_m)
            built = build_likelihood(self.levels[-1], cell_m=cell_m, heights=max(heights, HEIGHTS))
            self._grid = built
        return self._grid

    def find(self, points: Points, tangents: Points, *, uniqueness: float) -> Peak | None:
        """Where in the whole map surfaces seen from a base lie, whatever the base's heading.

        points, tangents : (n, 2) in the frame of the base. uniqueness : no other place may score
        more than the best divided by this. None where no place, or more than one, fits.
        """
        found = self.places(points, tangents, worse=uniqueness)
        return found[0] if len(found) == 1 else None

    def places(
        self, points: Points, tangents: Points, *, worse: float, least: float = LEAST_SCORE
    ) -> list[Peak]:
        """The best place in the whole map that scores `least`, and its best rival elsewhere.

        That is left out where its score is less than that of the best divided by `worse`.
        """
        unit = self.levels[-1].knot_step_m
        likelihood = self.likelihood(cell_m=unit, heights=HEIGHTS)
        every = max(1, math.ceil(len(points) / MOST_POINTS))
        # one layout for the compiler, whatever is left out
        points, tangents = points[::every].copy(), tangents[::every].copy()
        reach_m = 0.5 * float((self._high - self._low).max()) + MARGIN_STEPS * unit
        window = Window(np.array([*(0.5 * (self._low + self._high)), 0.0]), reach_m, math.pi)
        peak = search(likelihood, points, tangents, window, floor=least)
        if peak is None:
            return []
        rival = search(
            likelihood,
            points,
            tangents,
            window,
            floor=peak.score / worse,
            barred=peak,
            apart_m=10.0 * unit,
        )
        return [peak] if rival is None else [peak, rival]


def settings_for_map(settings: Part, document: MapDocument) -> Part:
    """The settings with degree and ladder of a map: its finest knot step ends the ladder."""
    finest = min(level.knot_step_m for level in document.levels)
    scale = finest / settings.ladder[-1]
    ladder = settings.ladder
    if abs(scale - 1.0) > 1e-6:
        ladder = tuple(scale * step for step in ladder)
    return replace(settings, degree=document.degree, ladder=(*ladder[:-1], finest))
