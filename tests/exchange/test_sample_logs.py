"""The sample logs are what their script makes and what their README says."""

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest

from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions

FOLDER = Path(__file__).parents[2] / "sample_logs"


def load_script():
    spec = importlib.util.spec_from_file_location("make_sample_logs", FOLDER / "make.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


SCRIPT = load_script()


def content(path):
    """What a log says, whatever the version of its compression; and its odometry apart."""
    with open_log([path], ReadOptions()) as reader:
        scans = list(reader.scans())
    poses = [scan.pose_odom_base for scan in scans if scan.pose_odom_base is not None]
    said = [
        (
            scan.topic,
            scan.stamp_ns,
            scan.ranges_m.tobytes(),
            scan.angle_min_rad,
            scan.angle_increment_rad,
            scan.range_min_m,
            scan.range_max_m,
            scan.pose_base_laser,
            scan.pose_odom_base is None,
        )
        for scan in scans
    ]
    return said, np.array(poses)


def poses_of(truth):
    return np.array([line.split() for line in truth.read_text().splitlines()], float)


@pytest.mark.parametrize("name", SCRIPT.SAMPLES)
def test_the_script_makes_the_same_log_again(name, tmp_path):
    SCRIPT.make(name, tmp_path)
    made, odometry = content(tmp_path / name)
    kept, odometry_kept = content(FOLDER / name)
    assert len(made) == len(kept)
    for one, other in zip(made, kept, strict=True):  # all at once, a difference takes hours to show
        assert one == other
    # another kind of processor may round the last digit of a sine otherwise
    np.testing.assert_allclose(odometry, odometry_kept, rtol=0.0, atol=1e-12)
    first = (tmp_path / name).read_bytes()
    SCRIPT.make(name, tmp_path)
    assert (tmp_path / name).read_bytes() == first
    for beside in tmp_path.iterdir():
        if beside.name != name:
            assert beside.read_bytes() == (FOLDER / beside.name).read_bytes(), beside.name


def test_nothing_else_lies_there_and_all_is_small():
    stems = {name.partition(".")[0] for name in SCRIPT.SAMPLES}
    expected = {"make.py", "README.md", *SCRIPT.SAMPLES}
    expected |= {f"{stem}.truth.tum" for stem in stems}
    expected |= {f"{sample['scene']}.surfaces.geojson" for sample in SCRIPT.SAMPLES.values()}
    files = [path for path in FOLDER.iterdir() if path.is_file()]
    assert {path.name for path in files} == expected
    assert sum(path.stat().st_size for path in files) < 2_000_000


@pytest.mark.parametrize("name", SCRIPT.SAMPLES)
def test_the_readme_counts_right(name):
    row = next(
        line for line in (FOLDER / "README.md").read_text().splitlines() if f"| `{name}`" in line
    )
    _, _, scene, _, scans, travelled, odometry, *_ = (cell.strip() for cell in row.split("|"))
    sample = SCRIPT.SAMPLES[name]
    poses = poses_of(FOLDER / f"{name.partition('.')[0]}.truth.tum")
    assert scene == f"`{sample['scene']}`"
    assert int(scans) == len(poses)
    assert (odometry == "yes") == sample.get("odometry", True)
    metres = re.match(r"([\d.]+) m", travelled)
    length = np.hypot(*np.diff(poses[:, 1:3], axis=0).T).sum()
    assert length == pytest.approx(float(metres[1]) if metres else 0.0, abs=0.51)
