"""The sample logs are what their script makes and what their README says."""

import gzip
import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.rosbag1 import Reader

FOLDER = Path(__file__).parents[2] / "sample_logs"


def load_script():
    spec = importlib.util.spec_from_file_location("make_sample_logs", FOLDER / "make.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


SCRIPT = load_script()


def content(path):
    """What a log says, whatever the version of its compression."""
    if path.suffix == ".gz":
        return gzip.decompress(path.read_bytes())
    if path.suffix == ".mcap":
        with path.open("rb") as stream:
            messages = make_reader(stream).iter_messages()
            return [(channel.topic, m.log_time, m.data) for _, channel, m in messages]
    with Reader(path) as reader:
        return [(c.topic, stamp_ns, bytes(data)) for c, stamp_ns, data in reader.messages()]


def poses_of(truth):
    return np.array([line.split() for line in truth.read_text().splitlines()], float)


@pytest.mark.parametrize("name", SCRIPT.SAMPLES)
def test_the_script_makes_the_same_log_again(name, tmp_path):
    SCRIPT.make(name, tmp_path)
    assert content(tmp_path / name) == content(FOLDER / name)
    first = (tmp_path / name).read_bytes()
    SCRIPT.make(name, tmp_path)
    assert (tmp_path / name).read_bytes() == first
    for made in tmp_path.iterdir():
        if made.name != name:
            assert made.read_bytes() == (FOLDER / made.name).read_bytes(), made.name


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
