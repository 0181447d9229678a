"""Sec. IV: the equations of pose and offset, each curve alone and all curves at once."""

import numpy as np
import pytest

from bsmap_cli.config import load_settings
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.curve_map import CurveMap
from bsmap_cli.mapping.fitting import fit_curve
from bsmap_cli.slam.curve_equations import CurveEquations, PairSystem
from bsmap_cli.slam.curve_matching import match_curves
from bsmap_cli.slam.curve_pairs import CurvePairs, _count_votes, pair_by_votes, scan_curves
from bsmap_cli.slam.curve_registration import curve_steps, join_poses, register_curves
from bsmap_cli.slam.joint_registration import (
    eliminate_offsets,
    offset_steps,
    register_jointly,
)
from tests.mapping.walls import arc, insert, line
from tests.slam.rooms import CENTRE, LOOSE, corridor_parts, map_of, room_parts, seen_from

PAPER = load_settings("paper", overrides=["ladder=[0.1]"])
DEFAULT = load_settings(overrides=["ladder=[0.1]", "registration.method=joint"])
STEP = 0.1
STILL = SE2.identity()


def winding(count=400, spacing=0.01, seed=2):
    """A smooth winding wall 1 to 2 m from the origin."""
    way = spacing * np.arange(count)
    heading = 0.9 * np.sin(2.1 * way + seed) + 0.3 * np.sin(5.0 * way)
    points = np.cumsum(spacing * np.column_stack((np.cos(heading), np.sin(heading))), axis=0)
    return points - points.mean(axis=0) + (0.3, 1.5)


def map_and_pairs(*parts, offset=0.0, pose=STILL, cut=slice(80, -80)):
    """A map of the parts, and a pair each with the middle of a part as seen from `pose`.

    offset [knot steps] : how far the pairs' first guess is from the truth.
    """
    curve_map, pairs = CurveMap(STEP, 3), CurvePairs()
    insert(curve_map, *parts, settings=PAPER)
    for index, part in enumerate(parts):
        seen = pose.inverse().transform(part[cut])
        curve = fit_curve(seen, PAPER.fitting, knot_step_m=STEP, degree=3)
        chords = np.hypot(*np.diff(part[: cut.start + 1], axis=0).T)
        support = (curve.tau_start_m / STEP, curve.tau_end_m / STEP)
        pairs.add(curve, support, index, chords.sum() / STEP + offset)
    return curve_map, pairs


def random_equations(random, count):
    rows = random.normal(size=(count, 12, 4))
    errors = random.normal(size=(count, 12))
    ones = np.ones(count)
    return CurveEquations(
        np.einsum("pri,prj->pij", rows, rows),
        np.einsum("pri,pr->pi", rows, errors),
        ones,
        ones,
        ones,
        ones,
    )


@pytest.mark.parametrize("count", [1, 2, 7, 30])
def test_schur_complement_equals_the_full_arrow_system(count):
    equations = random_equations(np.random.default_rng(count), count)
    full, right = np.zeros((3 + count, 3 + count)), np.zeros(3 + count)
    for p in range(count):
        index = np.array([0, 1, 2, 3 + p])
        full[np.ix_(index, index)] += equations.hessians[p]
        right[index] += equations.gradients[p]
    wanted = np.linalg.solve(full, right)
    system, pose_right = eliminate_offsets(equations)
    pose_step = np.linalg.solve(system, pose_right)
    np.testing.assert_allclose(pose_step, wanted[:3], atol=1e-12)
    np.testing.assert_allclose(offset_steps(equations, pose_step), wanted[3:], atol=1e-12)


def test_the_step_of_one_curve_solves_its_4_x_4_system():
    equations = random_equations(np.random.default_rng(4), 5)
    wanted = [
        np.linalg.solve(h, g) for h, g in zip(equations.hessians, equations.gradients, strict=True)
    ]
    np.testing.assert_allclose(curve_steps(equations, STEP), wanted, atol=1e-9)


def test_the_gradient_is_that_of_the_squared_error():
    """By finite differences; towards the offset the sign turns, as it is no argument shift."""
    curve_map, pairs = map_and_pairs(winding(), offset=0.3, pose=SE2(0.1, -0.2, 0.15))
    system = PairSystem(curve_map, pairs, samples=37)
    pose = np.array([0.13, -0.17, 0.12])

    def cost(at, offset):
        system.offsets = np.array([offset])
        return 0.5 * float(system.linearise(at[None]).squares[0])

    offset = pairs.offsets[0]
    system.offsets = np.array([offset])
    gradient = system.linearise(pose[None]).gradients[0]
    h = 1e-6
    for axis in range(3):
        ahead, behind = pose.copy(), pose.copy()
        ahead[axis] += h
        behind[axis] -= h
        slope = (cost(ahead, offset) - cost(behind, offset)) / (2 * h)
        assert -gradient[axis] == pytest.approx(slope, rel=1e-5, abs=1e-8)


def test_jacobians_of_the_pose_and_of_tau():
    """nabla_xi T and nabla_tau T of the paper, the latter with ds/dtau for the printed s/dtau."""
    curve_map, pairs = map_and_pairs(winding(), pose=SE2(0.1, -0.2, 0.15))
    curve, offset = pairs.curves[0], pairs.offsets[0]
    pose = np.array([0.11, -0.22, 0.14])
    system = PairSystem(curve_map, pairs, samples=25)
    equations = system.linearise(pose[None])
    map_curve = curve_map.curve(0)
    low = max(map_curve.tau_start_m / STEP, pairs.supports[0][0] + offset)
    high = min(map_curve.tau_end_m / STEP, pairs.supports[0][1] + offset)
    u = low + (high - low) * (np.arange(25) + 0.5) / 25

    def moved(at, shift):
        return SE2.from_array(at).transform(curve.evaluate((u - offset + shift) * STEP))

    h, columns = 1e-6, []
    for axis in range(3):
        step = h * np.eye(3)[axis]
        columns.append((moved(pose + step, 0) - moved(pose - step, 0)) / (2 * h))
    columns.append((moved(pose, h) - moved(pose, -h)) / (2 * h))
    rows = np.stack(columns, axis=-1).reshape(-1, 4)
    error = (map_curve.evaluate(u * STEP) - moved(pose, 0)).reshape(-1)
    weight = (high - low) / 25
    np.testing.assert_allclose(equations.hessians[0], weight * rows.T @ rows, atol=1e-6)
    np.testing.assert_allclose(equations.gradients[0], weight * rows.T @ error, atol=1e-8)


@pytest.mark.parametrize("degree", [2, 3, 4, 5])
def test_offset_and_pose_are_recovered(degree):
    """From 3 cm, 2 degrees and most of a knot step off, on exact points."""
    settings = load_settings("paper", overrides=["ladder=[0.1]", f"degree={degree}"])
    parts = [winding(), winding(seed=5) @ np.array([[0.0, 1.0], [-1.0, 0.0]])]
    curve_map, truth = CurveMap(STEP, degree), SE2(0.3, -0.2, 0.4)
    insert(curve_map, *parts, settings=settings)
    pairs = CurvePairs()
    for index, part in enumerate(parts):
        seen = truth.inverse().transform(part[100:-100])
        curve = fit_curve(seen, settings.fitting, knot_step_m=STEP, degree=degree)
        u = np.hypot(*np.diff(part[:101], axis=0).T).sum() / STEP
        pairs.add(curve, (0.0, curve.tau_end_m / STEP), index, u + (0.8, -0.6)[index])
    start = truth.as_array() + np.array([0.02, -0.02, 0.035])
    wanted = [u - wrong for u, wrong in zip(pairs.offsets, (0.8, -0.6), strict=True)]
    alone, jointly = (PairSystem(curve_map, pairs, samples=40) for _ in range(2))
    pose, used = register_curves(alone, start, reach_m=1.0, iterations=12)
    assert used.all()
    np.testing.assert_allclose(pose, truth.as_array(), atol=5e-4)
    np.testing.assert_allclose(alone.offsets, wanted, atol=1e-2)
    pose = register_jointly(jointly, start, start, LOOSE * 1e-6, variance_m2=1e-4, iterations=12)
    np.testing.assert_allclose(pose, truth.as_array(), atol=5e-4)
    np.testing.assert_allclose(jointly.offsets, wanted, atol=1e-2)


@pytest.mark.parametrize(
    ("part", "observed"),
    [
        (line((-2.0, 1.5), (2.0, 1.5), 0.01), 3),
        (arc((0.0, 0.5), 1.5, 2.8, 0.3, 0.01), 3),
        (
            np.concatenate(
                (line((-2.0, 1.5), (1.0, 1.5), 0.01), line((1.0, 1.49), (1.0, -1.5), 0.01))
            ),
            4,
        ),
    ],
    ids=["line", "arc", "corner"],
)
def test_what_one_curve_alone_tells(part, observed):
    """A straight wall and an arc leave one combination of pose and offset open."""
    curve_map, pairs = map_and_pairs(part)
    hessian = PairSystem(curve_map, pairs, samples=200).linearise(np.zeros((1, 3))).hessians[0]
    values = np.linalg.eigvalsh(hessian)
    assert np.sum(values > 1e-4 * values[-1]) == observed


def test_a_straight_wall_alone_keeps_the_way_along_it():
    curve_map, pairs = map_and_pairs(line((-2.0, 1.5), (2.0, 1.5), 0.01))
    system = PairSystem(curve_map, pairs, samples=20)
    start = np.array([0.07, 0.05, 0.02])
    pose, used = register_curves(system, start, reach_m=1.0, iterations=12)
    assert used.all()
    assert pose[1] + 0.07 * np.tan(pose[2]) == pytest.approx(0.0, abs=1e-4)
    assert pose[2] == pytest.approx(0.0, abs=1e-4)
    assert abs(pose[0] - 0.07) < 0.05


def test_joined_poses_weigh_with_what_each_curve_knows():
    """Two walls at right angles, each right across itself and wrong along itself."""
    walls = [line((-2.0, 1.5), (2.0, 1.5), 0.01), line((2.0, 1.5), (2.0, -2.0), 0.01)]
    curve_map, pairs = map_and_pairs(*walls)
    system = PairSystem(curve_map, pairs, samples=20)
    truth = np.zeros(3)
    equations = system.linearise(np.tile(truth, (2, 1)))
    apart = np.array([[0.5, 0.0, 0.0], [0.0, 0.5, 0.0]])
    joined = join_poses(truth, apart, equations, np.array([True, True]), STEP)
    np.testing.assert_allclose(joined, 0.0, atol=1e-3)
    kept = join_poses(truth, apart, equations, np.array([False, False]), STEP)
    np.testing.assert_array_equal(kept, truth)


def test_a_curve_that_does_not_fit_has_next_to_no_say():
    curve_map, pairs = map_and_pairs(winding(), winding(seed=5))
    equations = PairSystem(curve_map, pairs, samples=40).linearise(np.zeros((2, 3)))
    equations.squares[:] = equations.weights * np.array([1e-8, (0.2 * STEP) ** 2])
    apart = np.array([[0.01, 0.0, 0.0], [0.0, 0.05, 0.1]])
    joined = join_poses(np.zeros(3), apart, equations, np.array([True, True]), STEP)
    np.testing.assert_allclose(joined, apart[0], atol=1e-3)


def test_a_curve_that_would_move_the_robot_out_of_reach_has_no_say():
    curve_map, pairs = map_and_pairs(winding())
    start = np.array([0.1, 0.1, 0.05])
    system = PairSystem(curve_map, pairs, samples=40)
    pose, used = register_curves(system, start, reach_m=0.01, iterations=12)
    assert not used.any()
    np.testing.assert_array_equal(pose, start)


def test_votes_find_every_wall_and_its_offset():
    curve_map = map_of(room_parts())
    seen = seen_from(CENTRE, room_parts())
    curves = scan_curves(curve_map, seen, DEFAULT)
    wrong = CENTRE.as_array() + np.array([0.05, -0.04, 0.02])
    pairs = pair_by_votes(curve_map, curves, wrong)
    assert sorted(pairs.map_curves) == [0, 1, 2, 3, 4]
    for curve, index, offset in zip(pairs.curves, pairs.map_curves, pairs.offsets, strict=True):
        u = (curve.tau_start_m + 0.5) / STEP
        there = curve_map.curve(index).evaluate(np.array([(u + offset) * STEP]))
        here = CENTRE.transform(curve.evaluate(np.array([u * STEP])))
        assert np.hypot(*(there - here)[0]) < 0.15


def test_one_curve_of_a_scan_may_lie_on_two_of_the_map():
    halves = [line((-2.0, 1.5), (-0.05, 1.5)), line((0.05, 1.5), (2.0, 1.5))]
    curve_map = map_of(halves)
    whole = seen_from(STILL, [line((-1.5, 1.5), (1.5, 1.5))])
    pairs = pair_by_votes(curve_map, scan_curves(curve_map, whole, DEFAULT), np.zeros(3))
    assert pairs.map_curves == [0, 1]
    np.testing.assert_allclose(pairs.offsets, [5.0, -15.5], atol=0.1)
    np.testing.assert_allclose(pairs.supports, [(0.0, 14.5), (15.5, 30.0)], atol=0.6)


def test_votes_for_another_offset_do_not_count():
    """Where a curve comes near itself again, fewer samples say so: they are left out."""
    pairs, u = CurvePairs(), np.arange(0.0, 20.0, 0.5)
    curve = fit_curve(winding(), PAPER.fitting, knot_step_m=STEP, degree=3)
    u_map = u + np.where(u < 6.0, 40.0, 7.0)
    _count_votes(pairs, curve, u, np.zeros(len(u), np.int64), u_map)
    assert pairs.offsets == [7.0]
    assert pairs.supports == [(5.75, 19.75)]
    _count_votes(pairs, curve, u[:3], np.zeros(3, np.int64), u_map[:3])
    assert len(pairs) == 1  # three votes are none


def test_no_curve_near_no_pair():
    curve_map = map_of(room_parts())
    curves = scan_curves(curve_map, seen_from(CENTRE, room_parts()), DEFAULT)
    assert len(pair_by_votes(curve_map, curves, np.array([50.0, 0.0, 0.0]))) == 0
    assert len(pair_by_votes(curve_map, [], CENTRE.as_array())) == 0


@pytest.mark.parametrize("wrong", [(0.05, -0.04, 0.03), (-0.06, 0.05, -0.05)])
def test_joint_registration_finds_the_pose_in_a_room(wrong):
    curve_map, seen = map_of(room_parts()), seen_from(CENTRE, room_parts())
    start = CENTRE.as_array() + wrong
    pose = match_curves(curve_map, seen, start, start, LOOSE, sigma_m=0.001, settings=DEFAULT)
    np.testing.assert_allclose(pose, CENTRE.as_array(), atol=1e-3)


def test_joint_registration_invents_no_way_along_a_corridor():
    parts = corridor_parts(length=12.0)
    view = [part[100:-100] for part in corridor_parts(length=12.0)]
    truth = SE2(0.0, 0.7, 0.0)
    start = truth.as_array() + np.array([0.08, 0.05, 0.01])
    random = np.random.default_rng(0)
    noisy = [part + random.normal(0.0, 0.01, part.shape) for part in view]
    pose = match_curves(
        map_of(parts),
        seen_from(truth, noisy),
        start,
        start,
        np.diag([100.0, 100.0, 100.0]),
        sigma_m=0.01,
        settings=DEFAULT,
    )
    assert pose[0] == pytest.approx(0.08, abs=0.02)  # the prediction, not the truth
    assert pose[1] == pytest.approx(0.7, abs=5e-3)
    assert pose[2] == pytest.approx(0.0, abs=3e-3)


@pytest.mark.parametrize("profile", [PAPER, DEFAULT], ids=["curve", "joint"])
def test_an_empty_map_or_an_empty_scan_leaves_the_pose(profile):
    start = np.array([1.0, 2.0, 0.3])
    nothing = seen_from(CENTRE, [])
    for curve_map, seen in (
        (CurveMap(STEP, 3), seen_from(CENTRE, room_parts())),
        (map_of(room_parts()), nothing),
    ):
        pose = match_curves(curve_map, seen, start, start, LOOSE, sigma_m=0.01, settings=profile)
        np.testing.assert_allclose(pose, start, atol=1e-12)
