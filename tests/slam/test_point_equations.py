"""Points that touch the map, and what is told from there while the pose moves a little."""

import math

import numpy as np
import pytest

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.slam.point_equations import CONTACT, OFTEN, accumulate, touch
from bsmap_cli.slam.registration import NEAR, STILL
from tests.slam.rooms import CENTRE, PILLAR, RADIUS, map_of, room_parts, seen_from

STEP = 0.1
GATE_M, KERNEL_M, INLIER_M = 0.75 * STEP, 0.25 * STEP, 0.5 * STEP


def touched(curve_map, clusters, pose):
    """Rows and contacts of all points at a pose."""
    n = len(clusters.points)
    rows, places, contacts = np.full(n, -1), np.empty(n), np.zeros((n, CONTACT))
    touch(
        curve_map.arrays,
        curve_map.matrix,
        STEP,
        clusters.points,
        clusters.tangents,
        pose.as_array(),
        GATE_M,
        INLIER_M,
        rows,
        places,
        contacts,
    )
    return rows, contacts


def summed(points, rows, contacts, pose):
    """Hessian, gradient and tally at a pose."""
    hessian, gradient, tally = np.empty((3, 3)), np.empty(3), np.empty(5)
    accumulate(
        points,
        np.full(len(points), 1e-4),
        rows,
        contacts,
        pose.as_array(),
        KERNEL_M,
        INLIER_M,
        hessian,
        gradient,
        tally,
        np.empty((len(points), 5)),
    )
    return hessian, gradient, tally


@pytest.fixture(scope="module")
def room():
    return map_of(room_parts(), STEP), seen_from(CENTRE, room_parts(), STEP)


@pytest.mark.parametrize("heading", np.radians([0, 90, 200, 310]))
def test_a_step_from_contacts_nearby_is_that_from_contacts_here(room, heading):
    curve_map, clusters = room
    way_m = NEAR * STEP
    off = SE2(way_m * math.cos(heading), way_m * math.sin(heading), 0.0)
    there = CENTRE @ off
    steps = []
    for taken_at in (CENTRE, there):
        rows, contacts = touched(curve_map, clusters, taken_at)
        assert np.count_nonzero(rows >= 0) > 0.9 * len(rows)
        hessian, gradient, _ = summed(clusters.points, rows, contacts, there)
        steps.append(np.linalg.solve(hessian, gradient))
    # at the first contacts nothing is left to do: both lead back by the whole way
    assert np.hypot(*steps[1][:2]) == pytest.approx(way_m, rel=0.3)
    assert steps[0] == pytest.approx(steps[1], abs=STILL * STEP)


def test_residuals_follow_the_curvature(room):
    """Along the tangent of the pillar a point leaves it by s² / 2R, which a line would not tell."""
    curve_map, clusters = room
    rows, contacts = touched(curve_map, clusters, CENTRE)
    placed = CENTRE.transform(clusters.points)
    of_pillar = np.abs(np.hypot(*(placed - PILLAR).T) - RADIUS) < 0.01
    of_pillar &= (rows >= 0) & (contacts[:, 4] != 0.0)
    assert np.count_nonzero(of_pillar) > 20
    s = NEAR * STEP
    for j in np.flatnonzero(of_pillar):
        off = SE2(*(CENTRE.as_array() + np.append(s * contacts[j, 2:4], 0.0)))
        one = slice(j, j + 1)
        before, after = (
            summed(clusters.points[one], rows[one], contacts[one], pose)[2][1]
            for pose in (CENTRE, off)
        )
        expected_m = np.hypot(*(off.transform(clusters.points[one])[0] - PILLAR)) - RADIUS
        # what the map itself is off there, and a third of what the curvature makes
        assert math.sqrt(after) == pytest.approx(
            expected_m, abs=math.sqrt(before) + s * s / RADIUS / 6.0
        )


def test_gradient_is_that_of_the_residuals(room):
    """Far from the kernel's bend: half the derivative of the sum of squares, by differences."""
    curve_map, clusters = room
    rows, contacts = touched(curve_map, clusters, CENTRE)

    def gradient_and_cost(pose):
        hessian, gradient, tally = np.empty((3, 3)), np.empty(3), np.empty(5)
        accumulate(
            clusters.points,
            np.ones(len(rows)),
            rows,
            contacts,
            pose,
            1e6,
            1e6,
            hessian,
            gradient,
            tally,
            np.empty((len(rows), 5)),
        )
        return gradient, tally[1]

    pose = CENTRE.as_array() + np.array([0.01, -0.015, 0.004])
    gradient, _ = gradient_and_cost(pose)
    for k in range(3):
        nudge = np.zeros(3)
        nudge[k] = 1e-6
        slope = (gradient_and_cost(pose + nudge)[1] - gradient_and_cost(pose - nudge)[1]) / 2e-6
        assert -0.5 * slope == pytest.approx(gradient[k], rel=1e-5, abs=1e-7)


def test_a_wall_seen_often_has_no_surer_tangents():
    """Scans of one wall err alike; else a bare corridor would come to look observed."""
    clusters = seen_from(CENTRE, room_parts(), STEP)
    tilts = []
    for times in (20, 60):
        curve_map = map_of(room_parts(), STEP, times)
        rows, contacts = touched(curve_map, clusters, CENTRE)
        assert np.median(curve_map.arrays.weights[rows[rows >= 0] + 1]) > 2.0 * OFTEN
        tilts.append(np.median(contacts[rows >= 0, 5]))
    assert tilts[0] == tilts[1]


def test_a_point_beyond_reach_touches_nothing(room):
    curve_map, clusters = room
    away = CENTRE @ SE2(0.3, 0.3, 0.0)
    rows, contacts = touched(curve_map, clusters, away)
    placed = away.transform(clusters.points[rows >= 0])
    assert np.all(np.hypot(*(placed - contacts[rows >= 0, :2]).T) <= 1.1 * GATE_M)
    assert np.count_nonzero(rows < 0) > 0.5 * len(rows)
