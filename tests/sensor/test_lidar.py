import math
from dataclasses import replace

import numpy as np
import pytest

from bsmap_cli.sensor.simulator.lidar import LIDARS

MODELS = list(LIDARS.values())
UST = LIDARS["ust10lx"]


def measure(model, true_ranges, seed=0):
    return model.measure(np.asarray(true_ranges, float), np.random.default_rng(seed))


@pytest.mark.parametrize(
    ("name", "beams", "first_deg", "last_deg"),
    [
        ("ust10lx", 1081, -135.0, 135.0),
        ("utm30lx", 1081, -135.0, 135.0),
        ("lms200", 181, -90.0, 90.0),
        ("lms200half", 361, -90.0, 90.0),
        ("urg04lx", 683, -119.88, 119.88),
        ("lowcost360", 360, -180.0, 179.0),
    ],
)
def test_beams_as_in_the_data_sheet(name, beams, first_deg, last_deg):
    angles = np.degrees(LIDARS[name].beam_angles())
    assert len(angles) == beams
    assert angles[[0, -1]] == pytest.approx([first_deg, last_deg], abs=0.01)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_angles_are_float32_values(model):
    assert float(np.float32(model.angle_min_rad)) == model.angle_min_rad
    assert float(np.float32(model.angle_increment_rad)) == model.angle_increment_rad


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_the_mirror_is_fast_enough(model):
    assert model.rate_hz * model.turn_s <= 1.0 + 1e-9
    assert model.beams * model.time_increment_s <= model.turn_s + 1e-9


def test_noise_has_the_stated_spread_and_no_bias():
    errors = np.concatenate([measure(UST, np.full(1081, 3.0), seed) - 3.0 for seed in range(40)])
    count = len(errors)  # 43,240: the mean's own sigma is 48 um, that of the spread 34 um
    assert abs(errors.mean()) < 4 * 0.01 / math.sqrt(count)
    assert abs(errors.std() - 0.01) < 4 * 0.01 / math.sqrt(2 * count)
    within = np.mean(np.abs(errors) < 0.01)
    assert within == pytest.approx(0.6827, abs=4 * math.sqrt(0.68 * 0.32 / count))


def test_noise_of_neighbours_and_of_scans_is_independent():
    errors = np.stack([measure(UST, np.full(1081, 3.0), seed) - 3.0 for seed in range(60)])
    beside = np.corrcoef(errors[:, :-1].ravel(), errors[:, 1:].ravel())[0, 1]
    after = np.corrcoef(errors[:-1].ravel(), errors[1:].ravel())[0, 1]
    assert max(abs(beside), abs(after)) < 4 / math.sqrt(errors.size * 0.9)


def test_relative_noise_grows_with_the_range():
    model = replace(UST, range_sigma_share=0.01)
    near, far = (measure(model, np.full(1081, metres)).std() for metres in (0.5, 8.0))
    assert near == pytest.approx(0.01, rel=0.1)
    assert far == pytest.approx(0.08, rel=0.1)


def test_no_return_is_infinite_and_too_close_is_minus_infinite():
    exact = replace(UST, range_sigma_m=0.0)
    true = np.full(1081, 5.0)
    true[:4] = math.inf, 10.001, 0.059, 0.061
    ranges = measure(exact, true)
    assert ranges.dtype == np.float32
    assert ranges[:5].tolist() == [math.inf, math.inf, -math.inf, np.float32(0.061), 5.0]


def test_noise_never_leaves_the_limits():
    ranges = measure(UST, np.linspace(0.04, 10.02, 1081))
    finite = ranges[np.isfinite(ranges)]
    assert finite.min() >= np.float32(0.06)
    assert finite.max() <= np.float32(10.0)
    assert len(finite) < 1081


def test_outliers_and_dropouts_have_their_shares():
    model = replace(UST, outlier_share=0.05, dropout_share=0.1)
    ranges = np.concatenate([measure(model, np.full(1081, 3.0), seed) for seed in range(30)])
    lost = np.isinf(ranges)
    astray = ~lost & (np.abs(ranges - 3.0) > 0.06)
    spread = 4 * math.sqrt(0.1 * 0.9 / len(ranges))
    assert lost.mean() == pytest.approx(0.1, abs=spread)
    assert astray.mean() == pytest.approx(0.05 * 0.9 * (1 - 0.12 / 9.94), abs=spread)
    assert ranges[astray].max() - ranges[astray].min() > 9.0


def test_resolution_rounds():
    ranges = measure(replace(UST, resolution_m=0.001), np.linspace(1.0, 9.0, 1081))
    assert np.abs(ranges * 1000.0 - np.round(ranges * 1000.0)).max() < 1e-3
