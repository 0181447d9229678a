"""Which submaps may show what is seen from here."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.slam.viewpoints import EVERY, Viewpoints


class Seen:
    """A finished submap, as far as viewpoints are concerned."""

    def __init__(self, viewpoints):
        self.viewpoints = viewpoints
        self.extent_m = max((math.hypot(*point) for point in viewpoints), default=0.0)


def by_the_book(submaps, poses, here, view_m, reach_m, waits, most):
    """All ways, one by one, then sorted."""
    ways = []
    for submap, pose, reach, waiting in zip(submaps, poses, reach_m, waits, strict=True):
        x, y, _ = SE2.from_array(pose).inverse() @ here
        seen = [math.hypot(px - x, py - y) for px, py in submap.viewpoints[::EVERY]]
        ways.append(math.inf if waiting or not seen else min(seen) / (view_m + reach))
    order = sorted(range(len(ways)), key=lambda k: ways[k])
    return [k for k in order[:most] if ways[k] < 1.0]


@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_the_nearest_come_first(seed, most):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 12))
    submaps = [
        Seen([tuple(point) for point in rng.normal(0, 4, (int(rng.integers(0, 30)), 2))])
        for _ in range(count)
    ]
    poses = np.column_stack((rng.normal(0, 10, (count, 2)), rng.uniform(-3, 3, count)))
    if count > 1:  # two submaps that are equally far away
        submaps[-1], poses[-1] = submaps[0], poses[0]
    reach_m = rng.uniform(0, 6, count)
    reach_m[-1] = reach_m[0]
    waits = rng.random(count) < 0.2
    here = SE2(*rng.normal(0, 5, 2), 1.0)
    known = Viewpoints()
    for submap in submaps:
        known.add(submap)
    found = known.nearest(
        poses,
        here,
        8.0,
        reach_m,
        next_try_m=np.where(waits, 101.0, 100.0),
        travelled_m=100.0,
        most=most,
    )
    assert found == by_the_book(submaps, poses, here, 8.0, reach_m, waits, most)


def test_what_lies_beyond_all_sight_is_left_out():
    known = Viewpoints()
    known.add(Seen([(0.0, 0.0)]))
    asked = {"next_try_m": np.zeros(1), "travelled_m": 0.0, "most": 2}
    for x_m, expected in ((9.9, [0]), (10.1, [])):
        here = SE2(x_m, 0.0, 0.0)
        assert known.nearest(np.zeros((1, 3)), here, 8.0, np.array([2.0]), **asked) == expected
