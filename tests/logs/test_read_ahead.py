"""A log read in a second process: the same scans, the same report, the same troubles."""

import os
import signal
from dataclasses import fields
from itertools import islice
from multiprocessing import active_children
from pathlib import Path

import numpy as np
import pytest

from bsmap_cli.beside import CAN_FORK
from bsmap_cli.errors import LogError
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.read_ahead import BATCH, scans_ahead
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.sensor.scan import Scan

SAMPLES = Path(__file__).parents[2] / "sample_logs"
LOGS = sorted(path.name for kind in ("*.mcap", "*.bag", "*.csv.gz") for path in SAMPLES.glob(kind))

pytestmark = pytest.mark.skipif(not CAN_FORK, reason="no process is forked here")


def read(log, draw, **options):
    """The scans and the report."""
    with open_log([log], ReadOptions(**options)) as reader:
        return list(draw(reader)), reader.report


def assert_same(ahead, here):
    scans, report = ahead
    expected, expected_report = here
    assert len(scans) == len(expected)
    for scan, other in zip(scans, expected, strict=True):
        for name in (entry.name for entry in fields(Scan) if entry.name != "ranges_m"):
            assert getattr(scan, name) == getattr(other, name), name
        assert scan.ranges_m.dtype == other.ranges_m.dtype
        assert np.array_equal(scan.ranges_m, other.ranges_m, equal_nan=True)
        assert scan.ranges_m.flags.writeable == other.ranges_m.flags.writeable
    assert report == expected_report


@pytest.mark.parametrize("log", LOGS)
@pytest.mark.parametrize("options", [{}, {"odom": "none", "every": 3}, {"max_scans": BATCH}])
def test_every_sample_log(log, options):
    ahead = read(SAMPLES / log, scans_ahead, **options)
    assert len(ahead[0]) > 20
    assert_same(ahead, read(SAMPLES / log, lambda reader: reader.scans(), **options))
    assert not active_children()


def test_a_log_that_is_cut_off(tmp_path):
    log = tmp_path / "cut.mcap"
    whole = (SAMPLES / "wall.mcap").read_bytes()
    log.write_bytes(whole[: len(whole) // 2])
    ahead = read(log, scans_ahead)
    assert ahead[1].truncated
    assert_same(ahead, read(log, lambda reader: reader.scans()))


def test_a_log_without_scans():
    log = SAMPLES / "wall.mcap"
    said = []
    for draw in (scans_ahead, lambda reader: reader.scans()):
        with pytest.raises(LogError) as error:
            read(log, draw, start_s=1e6)
        said.append(str(error.value))
    assert said[0] == said[1]


@pytest.mark.parametrize("options", [{}, {"every": 3}])
@pytest.mark.parametrize("drawn", [1, BATCH, BATCH + 1])
def test_where_the_other_process_is_killed_the_rest_is_read_here(drawn, options):
    def draw(reader):
        scans = scans_ahead(reader)
        yield from islice(scans, drawn)
        (process,) = active_children()
        os.kill(process.pid, signal.SIGKILL)
        yield from scans

    log = SAMPLES / "loop.csv.gz"
    assert_same(read(log, draw, **options), read(log, lambda reader: reader.scans(), **options))


def test_an_error_comes_behind_the_scans_before_it(monkeypatch):
    with open_log([SAMPLES / "loop.csv.gz"], ReadOptions()) as reader:
        whole, good = type(reader).scans, BATCH + 3

        def torn(reader):
            yield from islice(whole(reader), good)
            raise LogError("the log is torn")

        monkeypatch.setattr(type(reader), "scans", torn)
        scans = scans_ahead(reader)
        assert len(list(islice(scans, good))) == good
        with pytest.raises(LogError, match="the log is torn"):
            next(scans)


def test_the_other_process_ends_when_nobody_wants_further_scans():
    with open_log([SAMPLES / "loop.csv.gz"], ReadOptions()) as reader:
        scans = scans_ahead(reader)
        assert len(list(islice(scans, 3))) == 3
        assert len(active_children()) == 1
        scans.close()
    assert not active_children()


def test_a_stream_is_read_here(monkeypatch):
    """The next scan may not be written yet, and a batch never be full."""
    with open_log([SAMPLES / "loop.csv.gz"], ReadOptions()) as reader:
        monkeypatch.setattr(type(reader), "is_stream", True)
        next(scans_ahead(reader))
        assert not active_children()
