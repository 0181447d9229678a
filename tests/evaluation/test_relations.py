"""The relations metric beside a plain loop, and on the reference of a real log."""

import math
from pathlib import Path

import numpy as np
import pytest

from bsmap_cli.errors import LogError
from bsmap_cli.evaluation.relations import parse_relations, relation_errors
from bsmap_cli.exchange.tum import read_tum
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.sensor.trajectory import Trajectory

DATA = Path(__file__).parents[3] / "shared" / "data"


def jittering(count, seed=0):
    """Poses whose stamps step back now and then, as in real logs."""
    rng = np.random.default_rng(seed)
    stamps = 10**18 + np.arange(count) * 10**8 + rng.integers(-9 * 10**7, 9 * 10**7, count)
    return Trajectory(stamps, rng.normal(0, [3, 3, 2], (count, 3)))


def naive(trajectory, lines):
    translations, rotations = [], []
    for line in lines:
        t1, t2, x, y, _, _, _, yaw = line.split()
        ends = []
        for text in (t1, t2):
            seconds, fraction = text.split(".")
            stamp = int(seconds) * 10**9 + int(fraction.ljust(9, "0"))
            off = [abs(int(s) - stamp) for s in trajectory.stamps_ns]
            ends.append(SE2.from_array(trajectory.poses[off.index(min(off))]))
            if min(off) > 10**8:
                ends.append(None)
        if None in ends:
            continue
        d = ends[0].inverse() @ ends[1]
        translations.append(math.hypot(d.x - float(x), d.y - float(y)))
        rotations.append(abs(math.degrees(math.remainder(d.theta - float(yaw), math.tau))))
    return translations, rotations


def test_beside_a_loop():
    trajectory = jittering(60)
    assert (np.diff(trajectory.stamps_ns) < 0).any()
    rng = np.random.default_rng(2)
    lines = []
    for _ in range(100):
        t1, t2 = rng.uniform(1e9 - 2, 1e9 + 8, 2)
        x, y, yaw = rng.normal(0, 2, 3)
        lines.append(f"{t1:.6f} {t2:.6f} {x:.6f} {y:.6f} 0 0 0 {yaw:.6f}")
    errors = relation_errors(trajectory, parse_relations(lines))
    translations, rotations = naive(trajectory, lines)
    assert 0 < len(errors.rows) < 100
    np.testing.assert_allclose(errors.translation_m, translations, atol=1e-9)
    np.testing.assert_allclose(errors.rotation_deg, rotations, atol=1e-9)
    figures = errors.as_json()
    assert figures["relations"] == 100
    assert figures["matched"] == len(translations)
    assert figures["translation"]["mean_m"] == pytest.approx(np.mean(translations))
    assert figures["translation"]["std_m"] == pytest.approx(np.std(translations))
    assert figures["rotation"]["mean_deg"] == pytest.approx(np.mean(rotations))
    assert figures["rotation"]["std_deg"] == pytest.approx(np.std(rotations))


def test_relations_of_the_trajectory_itself_are_met():
    trajectory = jittering(20)
    a, b = (SE2.from_array(trajectory.poses[k]) for k in (3, 17))
    d = a.inverse() @ b
    t1, t2 = (int(trajectory.stamps_ns[k]) for k in (3, 17))
    line = f"{t1 / 1e9:.6f} {t2 / 1e9:.6f} {d.x} {d.y} 0 0 0 {d.theta + math.tau}"
    errors = relation_errors(trajectory, parse_relations([line]))
    assert errors.translation_m[0] < 1e-9
    assert errors.rotation_deg[0] < 1e-9


def test_bad_lines_and_no_matches():
    with pytest.raises(LogError, match="line 2 of the relations"):
        parse_relations(["1 2 3 4 0 0 0 5", "1 2 3 4 0 0 5"])
    with pytest.raises(LogError, match="line 1 of the relations"):
        parse_relations(["1 2 nan 4 0 0 0 5"])
    relations = parse_relations(["# none near\n", "1 2 3 4 0 0 0 5\n"])
    with pytest.raises(LogError, match=r"within 0.1 s"):
        relation_errors(jittering(5), relations)
    with pytest.raises(LogError, match="no poses"):
        relation_errors(Trajectory(np.zeros(0, np.int64), np.zeros((0, 3))), relations)


@pytest.mark.skipif(not DATA.is_dir(), reason="the real logs of ../shared/data are not here")
def test_pseudo_relations_are_those_of_the_graph_they_were_made_from():
    with (DATA / "mit-csail.graph.tum").open() as file:
        trajectory = read_tum(file)
    with (DATA / "mit-csail.pseudo.relations").open() as file:
        figures = relation_errors(trajectory, parse_relations(file)).as_json()
    assert figures["matched"] == figures["relations"] > 0
    # both files are rounded to a micrometre
    assert figures["translation"]["mean_m"] < 2e-6
    assert figures["rotation"]["mean_deg"] < 2e-4
