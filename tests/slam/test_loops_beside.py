"""Loops looked for in a second process: what comes of it does not depend on that."""

import os
import signal
from pathlib import Path

import pytest

from bsmap_cli.beside import CAN_FORK
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.slam.loop_closure import LoopCloser
from bsmap_cli.slam.slam import Slam
from bsmap_cli.slam.slam_settings import SlamSettings

RING = Path(__file__).parents[2] / "sample_logs" / "loop.csv.gz"

pytestmark = pytest.mark.skipif(not CAN_FORK, reason="no process is forked here")


@pytest.fixture(scope="module")
def scans():
    with open_log([RING], ReadOptions()) as reader:
        return list(reader.scans())


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    """All loops are looked for in the other process."""
    monkeypatch.setattr("bsmap_cli.slam.slam.TRIES_HERE", 0)


def tracked(scans, cores):
    slam = Slam(SlamSettings(), cores=cores)
    for scan in scans:
        slam.process(scan)
    return slam


def results(slam):
    result = slam.finish()
    (level,) = result.document.levels
    points = level.control_points.tobytes()
    return points, result.trajectory.poses.tobytes(), result.figures


@pytest.fixture(scope="module")
def alone(scans):
    return results(tracked(scans, cores=1))


def test_the_same_to_the_byte(scans, alone):
    slam = tracked(scans, cores=2)
    assert slam._beside is not None
    tried_here = slam._closer.tried
    assert results(slam) == alone
    assert slam._closer.tried > tried_here  # the rest was looked for elsewhere
    assert alone[2]["loops"] > 0


def test_the_same_where_the_other_process_is_killed(scans, alone):
    slam = tracked(scans[: len(scans) // 2], cores=2)
    os.kill(slam._beside._other.process.pid, signal.SIGKILL)
    for scan in scans[len(scans) // 2 :]:
        slam.process(scan)
    assert results(slam) == alone


def test_the_same_where_there_is_no_process_to_be_had(scans, alone, monkeypatch):
    def fork():
        raise BlockingIOError("no more processes")

    monkeypatch.setattr(os, "fork", fork)
    slam = tracked(scans, cores=2)
    assert slam._beside is None
    assert results(slam) == alone


def test_what_goes_wrong_there_is_told_here(scans, monkeypatch, capfd):
    def fail(*_):
        raise ZeroDivisionError("of no use")

    monkeypatch.setattr(LoopCloser, "_try", fail)
    slam = tracked(scans, cores=2)
    with pytest.raises(ZeroDivisionError, match="of no use"):
        slam.finish()
    assert capfd.readouterr() == ("", "")
