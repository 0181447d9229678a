"""The pose graph: Jacobians, exact graphs, and loops that lie."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.slam.edges import EdgeList
from bsmap_cli.slam.pose_graph import REJECTED, linearise, optimise

seeds = st.integers(0, 2**32)
TRACKING = np.diag([1.0 / 0.02**2, 1.0 / 0.02**2, 1.0 / 0.004**2])
LOOP = np.diag([1.0 / 0.03**2, 1.0 / 0.03**2, 1.0 / 0.005**2])


def relative(a, b):
    return (SE2.from_array(a).inverse() @ SE2.from_array(b)).as_array()


def gap(poses, truth):
    """(n, 3) errors of the poses, each in its own frame."""
    return np.array([relative(b, a) for a, b in zip(poses, truth, strict=True)])


def linear(pose_i, pose_j, measured):
    """Residual of one edge and its derivatives."""
    residual, at_i, at_j = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    linearise(pose_i, pose_j, measured, residual, at_i, at_j)
    return residual, at_i, at_j


@given(seeds)
@settings(max_examples=40, deadline=None)
def test_jacobians_equal_finite_differences(seed):
    random = np.random.default_rng(seed)
    poses = random.uniform(-3.0, 3.0, (2, 3))
    measured = relative(*poses) + random.normal(0.0, 0.1, 3)
    _, *jacobians = linear(*poses, measured)
    for node, jacobian in enumerate(jacobians):
        for k in range(3):
            step = np.zeros_like(poses)
            step[node, k] = 1e-6
            ahead, behind = (linear(*(poses + s * step), measured)[0] for s in (1, -1))
            assert (ahead - behind) / 2e-6 == pytest.approx(jacobian[:, k], abs=1e-7)


@given(seeds)
@settings(max_examples=40, deadline=None)
def test_residuals_vanish_at_the_truth_and_are_measured_in_the_frame_of_the_first_node(seed):
    random = np.random.default_rng(seed)
    poses = random.uniform(-3.0, 3.0, (2, 3))
    measured = relative(*poses)
    assert linear(*poses, measured)[0] == pytest.approx(np.zeros(3), abs=1e-12)
    # whole turns are no residual
    turned = measured + np.array([0.0, 0.0, 4.0 * np.pi])
    assert linear(*poses, turned)[0] == pytest.approx(np.zeros(3), abs=1e-9)


def walk(count, random):
    """A way of about 1 m steps that turns gently."""
    poses = [SE2.identity()]
    for _ in range(count - 1):
        poses.append(poses[-1] @ SE2(1.0, random.normal(0, 0.1), random.normal(0.05, 0.2)))
    return np.array([pose.as_array() for pose in poses])


def chain(truth, random, sigma=(0.0, 0.0, 0.0)):
    """Edges along the way, and where they lead when followed one by one."""
    edges, guess = EdgeList(), [SE2.from_array(truth[0])]
    for k in range(1, len(truth)):
        step = relative(truth[k - 1], truth[k]) + random.normal(0.0, 1.0, 3) * sigma
        edges.add(k - 1, k, step, TRACKING, loop=False)
        guess.append(guess[-1] @ SE2.from_array(step))
    return edges, np.array([pose.as_array() for pose in guess])


@given(seeds, st.integers(2, 40), st.booleans())
@settings(max_examples=30, deadline=None)
def test_a_graph_without_noise_is_solved_exactly(seed, count, loops):
    random = np.random.default_rng(seed)
    truth = walk(count, random)
    edges, _ = chain(truth, random)
    if loops:
        for _ in range(4):
            i, j = random.integers(0, count, 2)
            if i != j:
                edges.add(i, j, relative(truth[i], truth[j]), LOOP, loop=True)
    start = truth + random.normal(0.0, 0.05, truth.shape)
    start[0] = truth[0]
    solved = optimise(start, edges)
    assert gap(solved.poses, truth) == pytest.approx(np.zeros((count, 3)), abs=1e-6)
    assert solved.loop_weights == pytest.approx(np.ones(len(solved.loop_weights)), abs=1e-6)
    assert np.array_equal(solved.poses[0], truth[0])


def test_the_anchor_stays_wherever_it_is():
    random = np.random.default_rng(2)
    truth = walk(20, random)
    edges, guess = chain(truth, random, (0.02, 0.02, 0.004))
    edges.add(0, 19, relative(truth[0], truth[19]), LOOP, loop=True)
    guess += (5.0, -3.0, 0.4)
    solved = optimise(guess, edges)
    assert np.array_equal(solved.poses[0], guess[0])


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_the_solution_does_not_depend_on_the_frame(seed):
    random = np.random.default_rng(seed)
    truth = walk(15, random)
    edges, guess = chain(truth, random, (0.02, 0.02, 0.004))
    edges.add(0, 14, relative(truth[0], truth[14]), LOOP, loop=True)
    pose = SE2.from_array(random.uniform(-3.0, 3.0, 3))
    moved = np.array([(pose @ SE2.from_array(row)).as_array() for row in guess])
    here, there = optimise(guess, edges).poses, optimise(moved, edges).poses
    expected = np.array([(pose @ SE2.from_array(row)).as_array() for row in here])
    assert gap(there, expected) == pytest.approx(np.zeros((15, 3)), abs=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_wrong_loops_are_rejected_and_right_ones_kept(seed):
    """METHOD 3.1: ten per cent of the loops are wrong; metres for plain least squares."""
    random = np.random.default_rng(seed)
    angle = np.linspace(0.0, 4.0 * np.pi, 200)
    truth = np.column_stack((10 * np.sin(angle), 10 - 10 * np.cos(angle), angle))
    edges, guess = chain(truth, random, (0.02, 0.02, 0.004))
    wrong = []
    for k in range(50):
        i = int(random.integers(0, 90))
        j = i + 99 + int(random.integers(0, 3))
        measured = relative(truth[i], truth[j]) + random.normal(0.0, 1.0, 3) * (0.02, 0.02, 0.004)
        wrong.append(k % 10 == 9)
        if wrong[-1]:
            j = int(random.integers(100, 200))
            measured = random.uniform(-3.0, 3.0, 3)
        edges.add(i, j, measured, LOOP, loop=True)
    solved = optimise(guess, edges)
    wrong = np.array(wrong)
    assert (solved.loop_weights[wrong] < REJECTED).all()
    assert (solved.loop_weights[~wrong] > REJECTED).mean() > 0.95
    assert np.hypot(*gap(solved.poses, truth)[:, :2].T).max() < 0.5


def test_right_loops_far_off_are_kept():
    """Tracking has lost 8 m on its way: only a kernel that begins wide still listens."""
    random = np.random.default_rng(5)
    angle = np.linspace(0.0, 4.0 * np.pi, 200)
    truth = np.column_stack((10 * np.sin(angle), 10 - 10 * np.cos(angle), angle))
    edges, guess = EdgeList(), [SE2.from_array(truth[0])]
    for k in range(1, len(truth)):
        step = relative(truth[k - 1], truth[k]) * (1.03, 1.0, 1.02)
        edges.add(k - 1, k, step, TRACKING, loop=False)
        guess.append(guess[-1] @ SE2.from_array(step))
    guess = np.array([pose.as_array() for pose in guess])
    for i in range(0, 100, 10):
        measured = relative(truth[i], truth[i + 99]) + random.normal(0.0, 0.01, 3) * (1, 1, 0.2)
        edges.add(i, i + 99, measured, LOOP, loop=True)
    off = [np.hypot(*gap(guess[[i + 99]], truth[[i + 99]])[0, :2]) for i in range(0, 100, 10)]
    assert max(off) > 2.0
    solved = optimise(guess, edges)
    assert (solved.loop_weights > REJECTED).all()


def test_graphs_of_nothing():
    assert optimise(np.zeros((0, 3)), EdgeList()).poses.shape == (0, 3)
    assert optimise(np.ones((1, 3)), EdgeList()).poses.tolist() == [[1.0, 1.0, 1.0]]
    assert optimise(np.ones((4, 3)), EdgeList()).poses.tolist() == [[1.0, 1.0, 1.0]] * 4
