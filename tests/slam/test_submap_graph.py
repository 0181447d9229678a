"""How surely two submaps know of each other: variances along the surest chain."""

import heapq
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsmap_cli.slam.submap_graph import surest_chains

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
    NODES,
    st.lists(VARIANCES, min_size=7, max_size=7),
    st.lists(st.tuples(NODES, NODES, VARIANCES), max_size=6),
)
def test_every_node_is_reached_over_the_surest_chain(source, links, loops):
    first, second, matches = ([loop[k] for loop in loops] for k in range(3))
    found = surest_chains(
        source,
        np.array([links, links[::-1]]),
        np.array(first, np.int64),
        np.array(second, np.int64),
        np.array([matches, matches[::-1]], float),
    )
    assert found[1] == pytest.approx(least_sums(source, links[::-1], first, second, matches[::-1]))
    assert found[0] == pytest.approx(least_sums(source, links, first, second, matches))
