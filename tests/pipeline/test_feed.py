"""Scans on their way from a log into the method."""

import time

import numpy as np
import pytest

from bsmap_cli.errors import LogError
from bsmap_cli.pipeline.feed import MOST_AHEAD, Feed, Silent
from bsmap_cli.sensor.scan import Scan


class Log:
    """A reader of so many scans that ends with an error, or waits before each."""

    def __init__(self, count, *, error=None, wait_s=0.0):
        self.count, self.error, self.wait_s = count, error, wait_s
        self.given = 0

    def scans(self):
        for stamp in range(self.count):
            time.sleep(self.wait_s)
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


def test_a_scan_of_a_slow_log_is_not_kept_waiting():
    log = Log(5, wait_s=0.02)
    for number, _ in enumerate(Feed(log, Silent()), start=1):
        assert log.given == number
