"""In which order to eliminate the unknowns of a sparse symmetric system, and what that fills in.

Approximate minimum degree on a quotient graph (Amestoy, Davis, Duff 1996), without supervariables:
what was eliminated stands for the clique it leaves behind, as an element of its neighbours.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bsmap_cli.geometry.compiled import inlined, kernel, part

Integers = NDArray[np.int64]


@kernel
def neighbours(count: int, first: Integers, second: Integers) -> tuple[Integers, Integers]:
    """(count + 1,) starts and the neighbours of each node, each once, from pairs of nodes."""
    starts = np.zeros(count + 2, np.int64)
    for e in range(len(first)):
        starts[first[e] + 2] += 1
        starts[second[e] + 2] += 1
    for i in range(2, count + 2):
        starts[i] += starts[i - 1]
    nodes = np.empty(2 * len(first), np.int64)
    for e in range(len(first)):
        nodes[starts[first[e] + 1]] = second[e]
        starts[first[e] + 1] += 1
        nodes[starts[second[e] + 1]] = first[e]
        starts[second[e] + 1] += 1
    met = np.full(count, -1)
    n = begin = 0
    for i in range(count):
        end = starts[i + 1]
        starts[i] = n
        for k in range(begin, end):
            j = nodes[k]
            if j != i and met[j] != i:
                met[j] = i
                nodes[n] = j
                n += 1
        begin = end
    starts[count] = n
    return starts[: count + 1], nodes[:n]


@inlined
def _unlink(head: Integers, after: Integers, before: Integers, degree: int, node: int) -> None:
    """Take a node out of the list of those of its degree."""
    if before[node] >= 0:
        after[before[node]] = after[node]
    else:
        head[degree] = after[node]
    if after[node] >= 0:
        before[after[node]] = before[node]


@inlined
def _link(head: Integers, after: Integers, before: Integers, degree: int, node: int) -> None:
    """Put a node first in the list of those of its degree."""
    after[node], before[node] = head[degree], -1
    if head[degree] >= 0:
        before[head[degree]] = node
    head[degree] = node


@part
def _sort_columns(place: Integers, starts: Integers, rows: Integers) -> None:
    """Turn the nodes of each column into their places, ascending: by rows, then by columns."""
    count, entries = len(place), starts[-1]
    row_starts, columns = np.zeros(count + 1, np.int64), np.empty(entries, np.int64)
    for k in range(entries):
        row_starts[place[rows[k]] + 1] += 1
    for row in range(count):
        row_starts[row + 1] += row_starts[row]
    free = row_starts.copy()
    for column in range(count):
        for k in range(starts[column], starts[column + 1]):
            row = place[rows[k]]
            columns[free[row]] = column
            free[row] += 1
    free = starts.copy()
    for row in range(count):
        for k in range(row_starts[row], row_starts[row + 1]):
            rows[free[columns[k]]] = row
            free[columns[k]] += 1


@kernel
def eliminate(  # noqa: PLR0912, PLR0915
    starts: Integers, nodes: Integers
) -> tuple[Integers, Integers, Integers]:
    """Places of the nodes in the order of elimination, and the structure of the factor.

    Parameters
    ----------
    starts, nodes : neighbours of each node, as of `neighbours`.

    Returns
    -------
    (n,) place of each node; (n + 1,) starts and the rows below the diagonal of each column of
    the factor, as places, ascending.
    """
    count = len(starts) - 1
    variables, elements = nodes.copy(), np.empty_like(nodes)
    variable_counts, element_counts = np.empty(count, np.int64), np.zeros(count, np.int64)
    for i in range(count):
        variable_counts[i] = starts[i + 1] - starts[i]
    degree = variable_counts.copy()
    head, after, before = np.full(count + 1, -1), np.full(count, -1), np.full(count, -1)
    for i in range(count - 1, -1, -1):
        _link(head, after, before, degree[i], i)
    place, met, met_element = np.full(count, -1), np.full(count, -1), np.full(count, -1)
    outside, dead = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    left, left_starts = np.empty(2 * len(nodes) + count, np.int64), np.zeros(count + 1, np.int64)
    least = 0
    for step in range(count):
        while head[least] < 0:
            least += 1
        p = head[least]
        _unlink(head, after, before, degree[p], p)
        begin = end = left_starts[step]
        if begin + degree[p] > len(left):
            longer = np.empty(2 * len(left) + degree[p], np.int64)
            for m in range(begin):
                longer[m] = left[m]
            left = longer
        met[p] = step
        for k in range(starts[p], starts[p] + variable_counts[p]):
            met[variables[k]] = step
            left[end] = variables[k]
            end += 1
        for k in range(starts[p], starts[p] + element_counts[p]):
            e = elements[k]
            dead[e] = True
            for m in range(left_starts[place[e]], left_starts[place[e] + 1]):
                if met[left[m]] != step:
                    met[left[m]] = step
                    left[end] = left[m]
                    end += 1
        place[p], left_starts[step + 1] = step, end
        for m in range(begin, end):
            i = left[m]
            for k in range(starts[i], starts[i] + element_counts[i]):
                e = elements[k]
                if met_element[e] != step:
                    met_element[e] = step
                    outside[e] = left_starts[place[e] + 1] - left_starts[place[e]]
                outside[e] -= 1
        for m in range(begin, end):
            i = left[m]
            beyond = 0
            kept = starts[i]
            for k in range(starts[i], starts[i] + element_counts[i]):
                e = elements[k]
                if not dead[e] and outside[e] > 0:
                    elements[kept] = e
                    kept += 1
                    beyond += outside[e]
            elements[kept] = p
            element_counts[i] = kept + 1 - starts[i]
            kept = starts[i]
            for k in range(starts[i], starts[i] + variable_counts[i]):
                if met[variables[k]] != step:
                    variables[kept] = variables[k]
                    kept += 1
            variable_counts[i] = kept - starts[i]
            bound = min(count - step - 2, degree[i] + end - begin - 1)
            _unlink(head, after, before, degree[i], i)
            degree[i] = min(bound, beyond + variable_counts[i] + end - begin - 1)
            _link(head, after, before, degree[i], i)
            least = min(least, degree[i])
    _sort_columns(place, left_starts, left)
    return place, left_starts, left[: left_starts[count]].copy()
