"""The live view, looked at by a viewer of its own over a websocket."""

import socket

import numpy as np
import pytest

from bsmap_cli.config import load_settings
from bsmap_cli.errors import BsmapError
from bsmap_cli.exchange import live_view
from bsmap_cli.exchange.live_view import HOST, LiveView
from bsmap_cli.logs.open_log import open_log
from bsmap_cli.logs.reader import ReadOptions
from bsmap_cli.pipeline import run_slam
from tests.cli.conftest import SAMPLES
from tests.exchange.exported import assert_same_lines
from tests.exchange.foxglove_client import Viewer

SCANS = 60


def port_of(view):
    return int(view.address.rpartition(":")[2])


@pytest.fixture(scope="module")
def watched():
    """A run of the first scans of a log, every scan shown: (log's scans, run, what was seen)."""
    patch = pytest.MonkeyPatch()
    patch.setattr(live_view, "SCANS_EVERY_S", 0.0)
    patch.setattr(live_view, "CURVES_EVERY_S", 0.0)
    options = ReadOptions(max_scans=SCANS)
    log = [str(SAMPLES / "shapes.mcap")]
    with open_log(log, options) as reader:
        scans = list(reader.scans())
    with patch.context(), LiveView(0) as view, open_log(log, options) as reader:
        viewer = Viewer(port_of(view))
        assert view.wait(30.0)
        run = run_slam(reader, load_settings(), None, view)
    patch.undo()
    viewer.end()
    return scans, run, viewer


def test_channels_have_the_schemas_of_the_viewer(watched):
    channels = watched[2].channels.values()
    assert {channel["topic"]: channel["schemaName"] for channel in channels} == {
        "/tf": "foxglove.FrameTransforms",
        "/scan": "foxglove.LaserScan",
        "/map/path": "foxglove.PosesInFrame",
        "/map/curves": "foxglove.SceneUpdate",
    }


def test_every_scan_is_shown_as_it_was_measured(watched):
    scans, _, viewer = watched
    shown = viewer.of("/scan")
    assert len(shown) == len(scans) == SCANS
    for scan, message in zip(scans, shown, strict=True):
        assert message.frame_id == "base_link"
        ranges = np.array(message.ranges)
        told = np.isfinite(ranges)
        assert told.any()
        np.testing.assert_array_equal(ranges[told], scan.ranges_m[told])
        angles = np.linspace(message.start_angle, message.end_angle, len(ranges))
        beams = scan.angle_min_rad + np.arange(len(ranges)) * scan.angle_increment_rad
        np.testing.assert_allclose(angles, beams, atol=1e-9)
        missing = ~np.isfinite(scan.ranges_m) | (scan.ranges_m > scan.range_max_m)
        assert (~told[missing]).all()


def test_the_viewer_s_clock_follows_the_log(watched):
    scans, _, viewer = watched
    assert viewer.clock[:SCANS] == [scan.stamp_ns for scan in scans]
    assert (np.diff(viewer.clock) >= 0).all()


def test_the_robot_is_shown_where_tracking_sees_it(watched):
    _, run, viewer = watched
    places = [
        (transform.translation.x, transform.translation.y)
        for message in viewer.of("/tf")
        for transform in message.transforms
        if transform.child_frame_id == "base_link"
    ]
    # the finished trajectory is that of tracking, refined
    np.testing.assert_allclose(places[:SCANS], run.trajectory.poses[:, :2], atol=0.05)
    np.testing.assert_allclose(places[-1], run.trajectory.poses[-1, :2], atol=1e-9)


def test_curves_are_shown_in_the_frames_of_their_submaps(watched):
    viewer = watched[2]
    frames = {t.child_frame_id for message in viewer.of("/tf") for t in message.transforms}
    entities = [entity for message in viewer.of("/map/curves")[:-1] for entity in message.entities]
    assert entities
    for entity in entities:
        assert entity.frame_id == entity.id
        assert entity.frame_id in frames
        assert entity.frame_locked


def test_in_the_end_the_finished_map_and_path_are_shown(watched):
    _, run, viewer = watched
    update = viewer.of("/map/curves")[-1]
    assert [deletion.type for deletion in update.deletions] == [1]  # all that was shown
    (entity,) = update.entities
    assert entity.frame_id == "map"
    lines = [[(p.x, p.y) for p in line.points] for line in entity.lines]
    assert_same_lines(lines, run.document.finest, 0.005)
    path = [(pose.position.x, pose.position.y) for pose in viewer.of("/map/path")[-1].poses]
    np.testing.assert_allclose(path, run.trajectory.poses[:, :2])


def test_who_comes_late_is_shown_what_there_is(monkeypatch):
    monkeypatch.setattr(live_view, "SCANS_EVERY_S", 0.0)
    log = [str(SAMPLES / "shapes.mcap")]

    class Halfway:
        """Lets a second viewer in after some scans."""

        def __init__(self, view):
            self.view, self.seen, self.late = view, 0, None

        def scan(self, scan, slam):
            self.seen += 1
            if self.seen == SCANS - 5:
                self.view._joined.anybody = False
                self.late = Viewer(port_of(self.view))
                assert self.view.wait(30.0)
            self.view.scan(scan, slam)

        def finished(self, document, trajectory):
            self.view.finished(document, trajectory)

    options = ReadOptions(max_scans=SCANS)
    with LiveView(0) as view, open_log(log, options) as reader:
        halfway = Halfway(view)
        run_slam(reader, load_settings(), None, halfway)
    halfway.late.end()
    first = halfway.late.of("/map/curves")[0]
    assert "submap 0" in {entity.id for entity in first.entities}
    assert len(halfway.late.of("/map/path")[0].poses) > 1


def test_a_port_in_use_is_said():
    with socket.socket() as taken:
        taken.bind((HOST, 0))
        taken.listen()
        with pytest.raises(BsmapError, match=r"nothing can be served on port \d+ of 127\.0\.0\.1"):
            LiveView(taken.getsockname()[1])


def test_it_is_served_to_this_machine_alone():
    with LiveView(0) as view:
        assert view.address.startswith("ws://127.0.0.1:")
        assert not view.wait(0.0)
