"""Registration of a scan on a map that is known exactly."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.slam import ladder
from bsmap_cli.slam.prediction import worst_sigma_m
from bsmap_cli.slam.registration import RegistrationSettings, register
from tests.mapping.walls import insert, line
from tests.slam.rooms import (
    CENTRE,
    LOOSE,
    corridor_parts,
    map_of,
    room_parts,
    seen_from,
    signed_distance,
)

ROOM = map_of(room_parts())
CORRIDOR = map_of(corridor_parts())
offsets = st.tuples(st.floats(-0.04, 0.04), st.floats(-0.04, 0.04), st.floats(-0.008, 0.008))
poses = st.builds(SE2, st.floats(-20, 20), st.floats(-20, 20), st.floats(-3.1, 3.1))


def run(curve_map, clusters, start, prior=None, information=LOOSE, **rest):
    start = np.asarray(start, float)
    return register(
        curve_map,
        clusters,
        start,
        start if prior is None else np.asarray(prior, float),
        information,
        sigma_m=rest.pop("sigma_m", 0.005),
        settings=rest.pop("settings", RegistrationSettings()),
        **rest,
    )


def test_oracle_22_information_equals_finite_differences_of_the_residuals():
    """The residual of a point is its distance along the normal; weights are equal without noise."""
    clusters = seen_from(CENTRE, [part[10:-10] for part in room_parts()])
    result = run(ROOM, clusters, CENTRE.as_array(), iterations=1)
    assert result.inlier_ratio == 1.0

    def residuals(pose):
        return signed_distance(SE2.from_array(pose).transform(clusters.points))

    jacobian = np.empty((len(clusters.points), 3))
    for k in range(3):
        step = np.zeros(3)
        step[k] = 1e-6
        ahead, behind = (residuals(CENTRE.as_array() + sign * step) for sign in (1, -1))
        jacobian[:, k] = (ahead - behind) / 2e-6
    expected = jacobian.T @ jacobian
    assert result.information / np.trace(result.information) == pytest.approx(
        expected / np.trace(expected), abs=2e-3
    )


@given(offsets)
@settings(max_examples=40, deadline=None)
def test_a_known_offset_is_recovered_without_noise(offset):
    clusters = seen_from(CENTRE, room_parts())
    result = run(ROOM, clusters, CENTRE.as_array() + offset)
    assert result.pose == pytest.approx(CENTRE.as_array(), abs=2e-4)
    assert result.inlier_ratio > 0.98
    assert result.degenerate == 0
    assert result.rms_m < 1e-3


@given(offsets, poses)
@settings(max_examples=25, deadline=None)
def test_registration_is_equivariant(offset, pose):
    clusters = seen_from(CENTRE, room_parts())
    start = SE2.from_array(CENTRE.as_array() + offset)
    here = run(ROOM, clusters, start.as_array())
    there = run(ROOM.moved(pose), clusters, (pose @ start).as_array())
    expected = pose @ SE2.from_array(here.pose)
    gap = expected.inverse() @ SE2.from_array(there.pose)
    assert gap.as_array() == pytest.approx(np.zeros(3), abs=2e-5)
    assert there.inlier_ratio == pytest.approx(here.inlier_ratio, abs=0.01)


@given(st.floats(-3.0, 3.0), st.floats(-0.03, 0.03), st.floats(-0.005, 0.005), poses)
@settings(max_examples=40, deadline=None)
def test_oracle_29_a_corridor_leaves_the_prediction_along_its_axis(along, across, turn, pose):
    corridor = CORRIDOR.moved(pose)
    middle = SE2(0.0, 1.0, 0.0)
    clusters = seen_from(middle, [part[150:250] for part in corridor_parts()])
    start = pose @ SE2(0.3 * along, 1.0 + across, turn)
    result = run(corridor, clusters, start.as_array())
    found = pose.inverse() @ SE2.from_array(result.pose)
    assert result.degenerate == 1
    assert found.x == pytest.approx(0.3 * along, abs=1e-4)
    assert (found.y, found.theta) == pytest.approx((1.0, 0.0), abs=2e-4)


@pytest.mark.parametrize("seed", range(5))
def test_oracle_29_noise_invents_no_motion_along_a_corridor(seed):
    random = np.random.default_rng(seed)

    def noisy():
        return [part + random.normal(0.0, 0.01, part.shape) for part in corridor_parts()]

    corridor = map_of(noisy(), times=1)
    clusters = seen_from(SE2(0.0, 1.0, 0.0), [part[100:300] for part in noisy()], sigma_m=0.01)
    result = run(corridor, clusters, (0.05, 1.02, 0.002), sigma_m=0.01)
    assert result.degenerate >= 1
    assert result.pose[0] == pytest.approx(0.05, abs=0.002)
    assert result.pose[1] == pytest.approx(1.0, abs=0.004)


def test_a_firm_prior_wins_and_a_loose_one_yields():
    clusters = seen_from(CENTRE, room_parts())
    prior = np.add(CENTRE.as_array(), (0.03, -0.02, 0.004))
    firm = run(ROOM, clusters, prior, information=np.eye(3) * 1e12)
    assert firm.pose == pytest.approx(prior, abs=1e-5)
    loose = run(ROOM, clusters, prior)
    assert loose.pose == pytest.approx(CENTRE.as_array(), abs=2e-4)


@pytest.mark.parametrize("turns", [-2, -1, 1, 3])
def test_a_prior_whole_turns_away_is_the_same_prior(turns):
    clusters = seen_from(CENTRE, room_parts())
    prior = np.add(CENTRE.as_array(), (0.0, 0.0, turns * math.tau))
    result = run(ROOM, clusters, CENTRE.as_array(), prior=prior, information=np.eye(3) * 1e9)
    assert result.pose == pytest.approx(CENTRE.as_array(), abs=1e-5)


def test_the_far_side_of_a_wall_is_no_match():
    clusters = seen_from(CENTRE, [part[::-1] for part in room_parts()])
    result = run(ROOM, clusters, CENTRE.as_array())
    assert result.inlier_ratio == 0.0
    assert result.pose == pytest.approx(CENTRE.as_array(), abs=1e-12)


@pytest.mark.parametrize("curve_map", [ROOM, map_of([])], ids=["room", "empty"])
@pytest.mark.parametrize("parts", [[], room_parts()], ids=["nothing", "everything"])
def test_nothing_to_match_keeps_the_prediction(curve_map, parts):
    if curve_map is ROOM and parts:
        parts = [part + 50.0 for part in parts]
    result = run(curve_map, seen_from(CENTRE, parts), CENTRE.as_array(), information=np.eye(3))
    assert result.pose == pytest.approx(CENTRE.as_array(), abs=1e-12)
    assert result.inlier_ratio == 0.0
    assert result.points == sum(len(part) for part in parts)


@pytest.mark.parametrize("seed", range(5))
def test_scattered_clutter_does_not_move_the_pose(seed):
    """A quarter of the points lie anywhere within the gate: the kernel leaves them aside."""
    random = np.random.default_rng(seed)
    parts = room_parts()
    for part in parts:
        stray = random.random(len(part)) < 0.25
        part[stray] += random.uniform(-0.07, 0.07, (stray.sum(), 2))
    clusters = seen_from(CENTRE, parts, sigma_m=0.01)
    result = run(ROOM, clusters, np.add(CENTRE.as_array(), (0.02, -0.02, 0.003)), sigma_m=0.01)
    assert result.pose == pytest.approx(CENTRE.as_array(), abs=0.004)


END = line((4.0, 0.3), (4.0, 1.7), 0.02)
MIDDLE = SE2(0.0, 1.0, 0.0)


@pytest.mark.parametrize("noise_m", [0.0, 0.01])
@pytest.mark.parametrize("seed", range(4))
def test_three_points_on_an_end_wall_tell_the_way_along_a_corridor(seed, noise_m):
    """Few as they are, they stand across the way, as no noise of the other walls would."""
    random = np.random.default_rng(seed)

    def noisy(parts):
        return [part + random.normal(0.0, noise_m, part.shape) for part in parts]

    curve_map = map_of(noisy([*corridor_parts(), END]), times=1)
    for _ in range(9):
        insert(curve_map, *noisy([*corridor_parts(), END]))
    sides = [part[100:300] for part in corridor_parts()]
    sigma_m = max(noise_m, 0.005)
    told = seen_from(MIDDLE, noisy([*sides, END[15:60:15]]), sigma_m=sigma_m)
    start = (0.03, 1.01, 0.001)
    result = run(curve_map, told, start, sigma_m=sigma_m)
    assert result.degenerate == 0
    assert result.pose[0] == pytest.approx(0.0, abs=0.002 + 2.0 * noise_m)
    assert run(curve_map, seen_from(MIDDLE, sides), start, sigma_m=sigma_m).degenerate == 1


def test_a_place_that_was_searched_for_needs_more_than_three_points():
    curve_map = map_of([*corridor_parts(), END], times=1)
    told = seen_from(MIDDLE, [*(part[100:300] for part in corridor_parts()), END[15:60:15]])
    start = (0.03, 1.01, 0.001)
    assert run(curve_map, told, start).degenerate == 0
    found = run(curve_map, told, start, settings=RegistrationSettings().far_off())
    assert found.degenerate == 1
    assert found.pose[0] == pytest.approx(0.03, abs=1e-3)


def test_the_worst_direction_of_a_match_is_that_along_the_corridor():
    sides = [*(part[100:300] for part in corridor_parts()), END]
    curve_map = map_of([*corridor_parts(), END])
    turned = SE2(0.0, 0.0, 0.7)
    result = run(curve_map, seen_from(MIDDLE, sides), MIDDLE.as_array())
    there = run(curve_map.moved(turned), seen_from(MIDDLE, sides), (turned @ MIDDLE).as_array())
    least = np.linalg.eigvalsh(result.information[:2, :2])[0]
    worst_m = worst_sigma_m(result.information)
    assert worst_m == pytest.approx(least**-0.5, rel=1e-6)
    assert worst_sigma_m(there.information) == pytest.approx(worst_m, rel=0.01)


@pytest.mark.parametrize(
    ("levels", "enough", "asked"), [(1, 2.0, 1), (1, 0.5, 1), (3, 0.5, 1), (3, 2.0, 1 + 3)]
)
def test_near_the_place_the_finest_level_is_asked_first_and_a_lone_one_once(
    levels, enough, asked, monkeypatch
):
    calls = []
    monkeypatch.setattr(
        ladder, "register", lambda *args, **rest: calls.append(args) or register(*args, **rest)
    )
    clusters, pose = seen_from(CENTRE, room_parts()), CENTRE.as_array()
    result = ladder.register_near(
        [ROOM] * levels,
        [clusters] * levels,
        pose,
        pose,
        LOOSE,
        enough=enough,
        sigma_m=0.005,
        settings=RegistrationSettings(),
    )
    assert len(calls) == asked
    assert result.inlier_ratio > 0.98


def in_pieces(parts, random):
    """The parts in stretches of 0.2 to 0.8 m, which become curves of their own."""
    pieces = []
    for part in parts:
        begin = 0
        while len(part) - begin >= 10:
            end = begin + int(random.integers(10, 40))
            pieces.append(part[begin:end])
            begin = end
    return pieces


@pytest.mark.parametrize("seed", range(20))
def test_what_is_told_of_a_match_is_true_at_the_pose_that_is_told(seed):
    """Points leave their curves on the way, and are looked for on the next ones.

    As they are found to a twentieth of a knot step, two of 400 may be on one side or the other.
    """
    random = np.random.default_rng(seed)
    pieces = in_pieces(room_parts(), random)
    curve_map = map_of([piece for piece in pieces if len(piece) >= 10])
    noisy = [part + random.normal(0.0, 0.005, part.shape) for part in room_parts()]
    clusters = seen_from(CENTRE, noisy, sigma_m=0.005)
    off = random.uniform(-1.0, 1.0, 3) * (0.06, 0.06, 0.015)
    found = run(curve_map, clusters, CENTRE.as_array() + off)
    judged = run(curve_map, clusters, found.pose, iterations=1)
    assert found.inlier_ratio == pytest.approx(judged.inlier_ratio, abs=0.005)
    assert np.diag(found.information) == pytest.approx(np.diag(judged.information), rel=0.02)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("waves_m", [0.005, 0.01])
def test_waves_that_were_seen_often_do_not_make_a_corridor_known(waves_m, seed):
    """The map's walls are wavy, as poses and lidar made them; the scan's are straight."""
    random = np.random.default_rng(seed)
    parts = corridor_parts()
    waves = [np.convolve(random.normal(size=430), np.hanning(31), "same")[:401] for _ in parts]
    waves = [waves_m * wave / wave.std() for wave in waves]
    curve_map = map_of([])
    for _ in range(20):
        wavy = [part + np.outer(wave, (0, 1)) for part, wave in zip(parts, waves, strict=True)]
        insert(curve_map, *(part + random.normal(0.0, 0.005, part.shape) for part in wavy))
    straight = [part[100:300] + random.normal(0.0, 0.005, (200, 2)) for part in parts]
    start = (0.05, 1.01, 0.001)
    result = run(curve_map, seen_from(SE2(0.0, 1.0, 0.0), straight, sigma_m=0.01), start)
    assert result.degenerate == 1
    assert result.pose[0] == pytest.approx(0.05, abs=2e-3)
