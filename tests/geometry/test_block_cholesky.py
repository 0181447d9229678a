"""Sparse systems of 3 x 3 blocks: structure by naive elimination, solutions by dense algebra."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.geometry.block_cholesky import factor, solve
from bsmap_cli.geometry.elimination import eliminate, neighbours

seeds = st.integers(0, 2**32)


def pairs(seed, most=30):
    """Nodes, and pairs of them: some twice, some of one node alone, some nodes in none."""
    random = np.random.default_rng(seed)
    count, edges = int(random.integers(1, most)), int(random.integers(0, 2 * most))
    return count, random.integers(0, count, edges), random.integers(0, count, edges)


@given(seeds)
@settings(max_examples=60, deadline=None)
def test_every_neighbour_is_named_once(seed):
    count, first, second = pairs(seed)
    starts, nodes = neighbours(count, first, second)
    for i in range(count):
        expected = {*second[first == i].tolist(), *first[second == i].tolist()} - {i}
        assert sorted(nodes[starts[i] : starts[i + 1]].tolist()) == sorted(expected)


@given(seeds)
@settings(max_examples=100, deadline=None)
def test_structure_is_what_elimination_in_that_order_fills_in(seed):
    count, first, second = pairs(seed)
    place, starts, rows = eliminate(*neighbours(count, first, second))
    assert sorted(place.tolist()) == list(range(count))
    below = [set() for _ in range(count)]
    for a, b in zip(place[first].tolist(), place[second].tolist(), strict=True):
        if a != b:
            below[min(a, b)].add(max(a, b))
    for j in range(count):
        column = sorted(below[j])
        assert rows[starts[j] : starts[j + 1]].tolist() == column
        if column:
            below[column[0]] |= set(column[1:])


def test_a_tree_fills_nothing_in():
    """Minimum degree takes the leaves first, whatever the numbering."""
    random = np.random.default_rng(3)
    parents = np.array([random.integers(0, k) for k in range(1, 200)])
    names = random.permutation(200)
    _, _, rows = eliminate(*neighbours(200, names[parents], names[np.arange(1, 200)]))
    assert len(rows) == 199


def system(seed):
    """Order and structure, dense matrix, and its blocks in the order of elimination."""
    count, first, second = pairs(seed)
    random = np.random.default_rng(seed)
    matrix = 0.1 * np.eye(3 * count)
    for a, b in zip(first, second, strict=True):
        jacobian = np.zeros((3, 3 * count))
        jacobian[:, 3 * a : 3 * a + 3] += random.normal(size=(3, 3))
        jacobian[:, 3 * b : 3 * b + 3] += random.normal(size=(3, 3))
        matrix += jacobian.T @ jacobian
    place, starts, rows = eliminate(*neighbours(count, first, second))
    order = np.argsort(place)
    tensor = matrix.reshape(count, 3, count, 3).transpose(0, 2, 1, 3)[np.ix_(order, order)]
    columns = np.repeat(np.arange(count), np.diff(starts))
    diagonal = tensor[np.arange(count), np.arange(count)].reshape(-1, 9).copy()
    lower = tensor[rows, columns].reshape(-1, 9).copy()
    return place, starts, rows, matrix, diagonal, lower


@given(seeds)
@settings(max_examples=60, deadline=None)
def test_solves_as_dense_algebra_does(seed):
    place, starts, rows, matrix, diagonal, lower = system(seed)
    wanted = np.random.default_rng(seed + 1).normal(size=(len(place), 3))
    right = (matrix @ wanted.ravel()).reshape(-1, 3)[np.argsort(place)]
    assert factor(starts, rows, diagonal, lower)
    solve(starts, rows, diagonal, lower, right)
    assert right[place] == pytest.approx(wanted, abs=1e-7)


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_what_is_not_positive_definite_is_refused(value):
    place, starts, rows, _, diagonal, lower = system(11)
    diagonal[len(place) // 2] = np.diag([1.0, value, 1.0]).ravel()
    assert not factor(starts, rows, diagonal, lower)
