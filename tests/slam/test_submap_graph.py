"""How surely two submaps know of each other: variances along the surest chain."""

import heapq
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsmap_cli.slam.surest_chains import SurestChains

NODES = st.integers(0, 7)
VARIANCES = st.floats(1e-3, 10.0)


def least_sums(source, links, first, second, matches):
    """Dijkstra's way, one node at a time."""
    edges = [(k, k + 1, value) for k, value in enumerate(links)]
    edges += list(zip(first, second, matches, strict=True))
    found = [math.inf] * (len(links) + 1)
    queue = [(0.0, source)]
    while queue:
        so_far, node = heapq.heappop(queue)
        if so_far >= found[node]:
            continue
        found[node] = so_far
        for i, j, value in edges:
            if node in (i, j):
                heapq.heappush(queue, (so_far + value, j if node == i else i))
    return found


@given(
    st.lists(VARIANCES, min_size=7, max_size=7),
    st.lists(st.tuples(NODES, NODES), max_size=12),
    st.lists(NODES, min_size=12, max_size=12),
    st.floats(1e-3, 10.0),
)
def test_every_node_is_reached_over_the_surest_chain(links, matches, sources, match):
    """Asked whenever something is new, which the last answer does not know of."""
    chains, kinds = SurestChains((match, 0.0)), (links, links[::-1])
    chains.begin()
    for count, values in enumerate(zip(*kinds, strict=True), 2):
        chains.begin(values)
        there = [(i, j) for i, j in matches if i < count and j < count]
        for i, j in there:
            if count - 1 in (i, j):
                chains.match(i, j)
        source = sources[count] % count
        found = chains.sums(source)
        first, second = [i for i, _ in there], [j for _, j in there]
        for sums, kind, value in zip(found, kinds, (match, 0.0), strict=True):
            same = [value] * len(there)
            expected = least_sums(source, kind[: count - 1], first, second, same)
            assert sums == pytest.approx(expected)


@given(
    NODES,
    st.lists(VARIANCES, min_size=7, max_size=7),
    st.lists(st.tuples(NODES, NODES, VARIANCES), max_size=6),
)
def test_another_kind_has_sums_of_its_own(source, links, loops):
    chains = SurestChains((1.0,))
    chains.begin()
    for _ in links:
        chains.begin((1.0,))
    for i, j, _ in loops:
        chains.match(i, j)
    first, second, matches = ([loop[k] for loop in loops if loop[0] != loop[1]] for k in range(3))
    assert [list(nodes) for nodes in chains.matches] == [first, second]
    sums = chains.sum_of(source, np.array(links), np.array(matches, float))
    assert sums == pytest.approx(least_sums(source, links, first, second, matches))
