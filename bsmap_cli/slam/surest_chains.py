"""How much errs at least between one node and each other, along chains of links and matches."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bsmap_cli.geometry.compiled import kernel
from bsmap_cli.geometry.se2 import Points, Vector
from bsmap_cli.slam.edges import Integers

LESS = 1.0 - 1e-12  # what is less by rounding alone is passed on to nobody


class _Mesh(NamedTuple):
    """Ends 2 e and 2 e + 1 of match e: each leads to a node, and on to the next end at its own.

    heads : (n,) the first end at each node; -1 where there is none, or no further one.
    """

    heads: Integers
    following: Integers
    leads_to: Integers


class SurestChains:
    """Nodes, each linked to the one before, and matches across that all err alike.

    What errs comes in m kinds, each of which adds up along a chain; sums are the least of all
    chains, of each kind its own. Nodes and matches are only ever added, so that the last answer
    bounds the next one, and what that costs is what has changed.
    """

    def __init__(self, match: Sequence[float]) -> None:
        self._match = np.array(match, float)
        self._links = [array("d") for _ in match]
        self._heads, self._following, self._leads_to = array("q"), array("q"), array("q")
        self._touched: list[int] = []
        self._sums = np.empty((len(self._match), 0))

    def __len__(self) -> int:
        return len(self._heads)

    def begin(self, link: Sequence[float] = ()) -> None:
        """One node more; link : (m,) what errs from the one before."""
        if len(self):
            for kind, value in zip(self._links, link, strict=True):
                kind.append(value)
            self._touched.append(len(self) - 1)
        self._heads.append(-1)

    def match(self, i: int, j: int) -> None:
        """Two nodes see each other."""
        if i == j:
            return
        for here, there in ((i, j), (j, i)):
            self._following.append(self._heads[here])
            self._heads[here] = len(self._leads_to)
            self._leads_to.append(there)
        self._touched += (i, j)

    @property
    def matches(self) -> tuple[Integers, Integers]:
        """(e,) and (e,) nodes that see each other, in the order in which they were matched."""
        ends = np.array(self._leads_to, np.int64)
        return ends[1::2], ends[::2]

    @property
    def links(self) -> list[Vector]:
        """(n - 1,) of each kind, what errs from node to node."""
        return [np.array(kind, float) for kind in self._links]

    def sums(self, source: int) -> Points:
        """(m, n) of what errs from node `source` to every node."""
        known, links = self._sums, self.links
        sums = np.full((len(self._match), len(self)), math.inf)
        sums[:, : known.shape[1]] = known
        mesh, queue = self._mesh(), np.empty(len(self), np.int64)
        touched, begun = np.array(self._touched, np.int64), np.array([source])
        for kind, match in enumerate(self._match.tolist()):
            matches = np.full(len(self._leads_to) // 2, match)
            if known.shape[1]:
                # by way of the last source at the most
                _pass_on(touched, links[kind], matches, *mesh, queue, sums[kind])
                sums[kind] += sums[kind, source]
            sums[kind, source] = 0.0
            _pass_on(begun, links[kind], matches, *mesh, queue, sums[kind])
        self._sums, self._touched = sums, []
        return sums

    def sum_of(self, source: int, links: Vector, matches: Vector) -> Vector:
        """(n,) the same of one kind more: (n - 1,) of the links and (e,) of the matches."""
        sums = np.full(len(self), math.inf)
        sums[source] = 0.0
        queue = np.empty(len(self), np.int64)
        _pass_on(np.array([source]), links, matches, *self._mesh(), queue, sums)
        return sums

    def _mesh(self) -> _Mesh:
        columns = (self._heads, self._following, self._leads_to)
        return _Mesh(*(np.array(column, np.int64) for column in columns))


@kernel
def _pass_on(
    begun: Integers,
    links: Vector,
    matches: Vector,
    heads: Integers,
    following: Integers,
    leads_to: Integers,
    queue: Integers,
    sums: Vector,
) -> None:
    """Let nodes tell their neighbours, and these theirs, until no sum gets less."""
    n = len(sums)
    waiting = np.zeros(n, np.bool_)
    first = count = 0
    for node in begun:
        if not waiting[node]:
            waiting[node] = True
            queue[count] = node
            count += 1
    while count:
        here = queue[first]
        first = first + 1 if first + 1 < n else 0
        count -= 1
        waiting[here] = False
        end = heads[here]
        side = 0
        while side < 2 or end >= 0:
            if side < 2:  # the nodes before and behind it
                there = here - 1 + 2 * side
                side += 1
                if there < 0 or there >= n:
                    continue
                value = sums[here] + links[min(here, there)]
            else:
                there = leads_to[end]
                value = sums[here] + matches[end >> 1]
                end = following[end]
            if value < LESS * sums[there]:
                sums[there] = value
                if not waiting[there]:
                    waiting[there] = True
                    last = first + count
                    queue[last if last < n else last - n] = there
                    count += 1
