"""The MCAP for viewers, read by the mcap and rosbags libraries."""

import io
import json
from dataclasses import replace
from itertools import chain

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bsmap_cli.exchange.selection import select
from bsmap_cli.exchange.viewer_mcap import write_viewer_mcap
from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.mapping.map_document import MapDocument, MapLevel
from bsmap_cli.sensor.scan import Scan
from bsmap_cli.sensor.trajectory import Trajectory
from tests.exchange.exported import assert_same_lines, wavy_document, written
from tests.maps import make_level, room_document

SECOND = 1_000_000_000


def messages(data):
    """(topic, type, stamp, message) of all messages, decoded by the schemas in the file."""
    typestore = get_typestore(Stores.EMPTY)
    found = []
    for schema, channel, message in make_reader(io.BytesIO(data)).iter_messages():
        if channel.message_encoding == "json":
            assert json.loads(schema.data)["title"] == schema.name
            decoded = json.loads(message.data)
        else:
            typestore.register(get_types_from_msg(schema.data.decode(), schema.name))
            decoded = typestore.deserialize_cdr(message.data, schema.name)
        found.append((channel.topic, schema.name, message.log_time, decoded))
    return found


def trajectory():
    stamps = np.array([5, 6, 7]) * SECOND + 123
    return Trajectory(stamps, np.array([[1.0, 1.0, 0.0], [1.5, 1.0, 0.5], [2.0, 1.5, 1.0]]))


def scan(stamp_ns, **options):
    ranges = np.full(5, 2.0, np.float32)
    return Scan(
        stamp_ns=stamp_ns, ranges_m=ranges, angle_min_rad=-1.0, angle_increment_rad=0.5, **options
    )


def test_line_strips_are_the_curves():
    document = wavy_document()
    (found,) = [
        m for m in messages(written(write_viewer_mcap, select(document))) if "curves" in m[0]
    ]
    assert found[1] == "foxglove.SceneUpdate"
    (entity,) = found[3]["entities"]
    assert entity["frame_id"] == "map"
    lines = [[(p["x"], p["y"]) for p in line["points"]] for line in entity["lines"]]
    assert len(lines) == 4
    assert {line["type"] for line in entity["lines"]} == {0}
    assert_same_lines(lines, document.finest)


def test_curves_of_a_large_map_have_several_topics(monkeypatch):
    document = replace(wavy_document(levels=(0.2, 0.1)), parts=True)
    (whole,) = messages(written(write_viewer_mcap, select(document)))[:1]
    monkeypatch.setattr(MapLevel.portions, "__defaults__", (20,))
    parts = messages(written(write_viewer_mcap, select(document)))
    parts = [message for message in parts if "curves" in message[0]]
    assert [topic for topic, *_ in parts] == ["/map/curves", "/map/curves/2", "/map/curves/3"]
    for k in (0, 1):
        level = f"curves {document.levels[k].knot_step_m:g}"
        entities = [entity for message in parts for entity in message[3]["entities"]]
        lines = [entity["lines"] for entity in entities if entity["id"] == level]
        assert whole[3]["entities"][k]["lines"] == list(chain.from_iterable(lines))


def test_path_and_grid():
    data = written(write_viewer_mcap, select(room_document(), trajectory=trajectory()))
    by_topic = {topic: (type_, stamp, m) for topic, type_, stamp, m in messages(data)}
    type_, stamp, path = by_topic["/map/path"]
    assert (type_, stamp) == ("nav_msgs/msg/Path", 5 * SECOND + 123)
    positions = [(p.pose.position.x, p.pose.position.y) for p in path.poses]
    np.testing.assert_allclose(positions, trajectory().poses[:, :2])
    _, _, grid = by_topic["/map/grid"]
    cells = np.array(grid.data).reshape(grid.info.height, grid.info.width)
    origin = grid.info.origin.position

    def state(x, y):
        return cells[
            int((y - origin.y) / grid.info.resolution), int((x - origin.x) / grid.info.resolution)
        ]

    assert state(1.0, 2.0) == 0
    assert state(4.0, 2.0) == -1
    assert set(np.unique(cells)) == {-1, 0, 100}


def test_scans_are_placed_along_the_path():
    laser = SE2(0.1, 0.0, 0.2)
    scans = [scan(int(stamp) + 10, pose_base_laser=laser) for stamp in trajectory().stamps_ns]
    selection = select(room_document(), trajectory=trajectory())
    found = messages(written(write_viewer_mcap, selection, scans=scans))
    transforms = [m for topic, _, _, m in found if topic == "/tf"]
    assert len(transforms) == 3
    for message, pose in zip(transforms, trajectory().poses, strict=True):
        (one,) = message.transforms
        assert (one.header.frame_id, one.child_frame_id) == ("map", "base_link")
        rotation = one.transform.rotation
        yaw = 2 * np.arctan2(rotation.z, rotation.w)
        np.testing.assert_allclose(
            [one.transform.translation.x, one.transform.translation.y, yaw], pose, atol=1e-12
        )
    laser_scans = [m for topic, _, _, m in found if topic == "/scan"]
    assert [s.header.frame_id for s in laser_scans] == ["laser"] * 3
    assert [topic for topic, *_ in found].count("/tf_static") == 1


@pytest.mark.parametrize("with_path", [True, False])
def test_without_stamps_the_map_stands_at_zero(with_path):
    found = messages(written(write_viewer_mcap, select(room_document(with_path=with_path))))
    assert {stamp for _, _, stamp, _ in found} == {0}
    assert ("/map/path" in {topic for topic, *_ in found}) == with_path


def test_the_same_map_gives_the_same_bytes():
    first, second = (written(write_viewer_mcap, select(wavy_document())) for _ in range(2))
    assert first == second


def test_an_empty_map_is_a_file_too():
    document = MapDocument(degree=3, max_weight=50, levels=(make_level([]),))
    assert [m[0] for m in messages(written(write_viewer_mcap, select(document)))] == ["/map/curves"]
