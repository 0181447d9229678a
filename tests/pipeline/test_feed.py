"""Scans on their way from a log into the method."""

import numpy as np
import pytest

from bsmap_cli.errors import LogError
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.pipeline.feed import MOST_AHEAD, Feed, Silent
from bsmap_cli.sensor.scan import Scan
from tests.acceptance.driving import SAMPLES


class Log:
    """A reader of so many scans, which may end with an error."""

    def __init__(self, count, *, error=None, is_stream=False):
        self.count, self.error, self.is_stream = count, error, is_stream
        self.given = 0

    def scans(self):
        for stamp in range(self.count):
            self.given += 1
            yield Scan(
                stamp_ns=stamp,
                ranges_m=np.ones(3, np.float32),
                angle_min_rad=0.0,
                angle_increment_rad=0.1,
            )
        if self.error:
            raise self.error


@pytest.mark.parametrize("count", [1, MOST_AHEAD - 1, MOST_AHEAD, MOST_AHEAD + 1, 1000])
def test_all_scans_come_in_their_order(count):
    feed = Feed(Log(count), Silent())
    assert [scan.stamp_ns for scan in feed] == list(range(count))
    assert feed.count == count


@pytest.mark.parametrize("count", [1, MOST_AHEAD, 100])
def test_scans_before_an_error_come_first(count):
    seen = []
    with pytest.raises(LogError, match="torn"):
        for scan in Feed(Log(count, error=LogError("the log is torn")), Silent()):
            seen.append(scan.stamp_ns)
    assert seen == list(range(count))


def test_a_scan_of_a_stream_is_not_kept_waiting():
    log = Log(5, is_stream=True)
    for number, _ in enumerate(Feed(log, Silent()), start=1):
        assert log.given == number


def test_a_log_in_files_is_read_some_scans_at_a_time():
    log = Log(3 * MOST_AHEAD)
    next(iter(Feed(log, Silent())))
    assert log.given == MOST_AHEAD


def test_a_pipe_is_a_stream_and_a_file_is_none():
    log = SAMPLES / "corridor.mcap"
    with open_log([log], ReadOptions()) as reader:
        assert not reader.is_stream
    with log.open("rb") as stream, open_log([stream], ReadOptions()) as reader:
        assert reader.is_stream
