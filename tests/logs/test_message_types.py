"""MultiEchoLaserScan, PointCloud2 and scans whose definition is not the usual one."""

import io
import math

import numpy as np
import pytest
from mcap.writer import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from bsmap_cli.geometry.se2 import SE2
from bsmap_cli.logs.decode_known import LASER_SCAN_TYPES, ODOMETRY_TYPES, usual_definition
from tests.logs.making import (
    SCAN,
    SECOND_NS,
    TF,
    Ros,
    assert_same,
    json_scan,
    read,
    ros_mcap,
    some_scans,
)

ROS = Ros()
T0 = 1_500_000_000 * SECOND_NS
CLOUD, ECHO = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/MultiEchoLaserScan"


def drive(tmp_path, messages, **options):
    path = tmp_path / "log.mcap"
    path.write_bytes(ros_mcap(messages, ROS))
    return read(path, **options)


@pytest.mark.parametrize("types", [LASER_SCAN_TYPES, ODOMETRY_TYPES], ids=lambda types: types[0])
@pytest.mark.parametrize("store", [Stores.ROS1_NOETIC, Stores.ROS2_FOXY, Stores.LATEST])
def test_what_is_decoded_without_rosbags_is_what_ros_defines(types, store):
    ours, ros = get_typestore(Stores.EMPTY), get_typestore(store)
    text = usual_definition(types[0], is_ros1=store is Stores.ROS1_NOETIC)
    ours.register(get_types_from_msg(text, types[0]))
    for name in types:
        assert ours.fielddefs[name] == ros.fielddefs[name]


def test_first_and_last_echo(tmp_path):
    echoes = [[1.0, 4.0], [], [2.0], [3.0, 5.0, 6.0]]
    message = ROS.MultiEchoLaserScan(
        header=ROS.header(T0, "laser"),
        angle_min=-0.5,
        angle_max=0.5,
        angle_increment=0.25,
        time_increment=0.0,
        scan_time=0.0,
        range_min=0.1,
        range_max=30.0,
        ranges=[ROS.LaserEcho(echoes=np.array(e, np.float32)) for e in echoes],
        intensities=[],
    )
    for last_echo, expected in ((False, [1, np.nan, 2, 3]), (True, [4, np.nan, 2, 6])):
        (scan,), _ = drive(tmp_path, [("/echoes", ECHO, T0, message)], last_echo=last_echo)
        np.testing.assert_array_equal(scan.ranges_m, np.float32(expected))


def cloud(points, stamp_ns=T0, *, bigendian=False, height=1, extra=b"", frame="lidar"):
    """x, y, z as float32 behind four bytes of something else, and `extra` behind each row."""
    order = ">" if bigendian else "<"
    data = np.zeros(len(points), [("i", "u4"), ("p", f"{order}f4", 3), ("q", "u2")])
    data["p"] = points
    width = len(points) // height
    rows = data.reshape(height, width)
    raw = b"".join(row.tobytes() + extra for row in rows)
    fields = [
        ROS.PointField(name=name, offset=4 + 4 * i, datatype=7, count=1)
        for i, name in enumerate("xyz")
    ]
    return ROS.PointCloud2(
        header=ROS.header(stamp_ns, frame),
        height=height,
        width=width,
        fields=fields,
        is_bigendian=bigendian,
        point_step=data.itemsize,
        row_step=width * data.itemsize + len(extra),
        data=np.frombuffer(raw, np.uint8),
        is_dense=False,
    )


def ring(radius_m, count, z_m, seed=0):
    """A round wall at one height, its points in no order."""
    angles = np.arange(count) * math.tau / count + 0.001
    points = np.stack((radius_m * np.cos(angles), radius_m * np.sin(angles), 0 * angles + z_m), -1)
    return np.random.default_rng(seed).permutation(points)


@pytest.mark.parametrize("bigendian", [False, True])
@pytest.mark.parametrize("layout", [(1, b""), (4, b""), (4, b"pad")])
def test_a_slice_of_a_cloud(tmp_path, bigendian, layout):
    """Floor and ceiling are cut away, the nearer of two walls is seen, in the frame of the base."""
    floor = ring(1.0, 400, -0.9)
    near, far = ring(4.0, 800, 0.0), ring(6.0, 800, 0.05)
    nowhere = np.full((4, 3), np.nan)
    points = np.concatenate((floor, near, far, nowhere))
    half = math.radians(20)
    static = ROS.transforms(
        (T0, "base_link", "lidar", (0.5, 0.0, 1.0), (0.0, 0.0, math.sin(half), math.cos(half)))
    )
    message = cloud(points, bigendian=bigendian, height=layout[0], extra=layout[1])
    messages = [("/tf_static", TF, T0, static), ("/points", CLOUD, T0, message)]
    (scan,), report = drive(tmp_path, messages, z_min_m=0.5, z_max_m=1.5)
    assert scan.pose_base_laser == SE2(0.5, 0.0, 0.0)
    assert report.warnings == []
    assert len(scan.ranges_m) > 300
    np.testing.assert_allclose(scan.ranges_m, 4.0, rtol=1e-5)
    span = len(scan.ranges_m) * scan.angle_increment_rad
    assert span == pytest.approx(math.tau)


def test_a_wall_keeps_its_place_in_a_slice(tmp_path):
    """Points of a flat wall come back on the wall, to the width of a beam."""
    y = np.linspace(-3.0, 3.0, 900)
    wall = np.stack((0 * y + 2.0, y, 0 * y), -1)
    (scan,), _ = drive(tmp_path, [("/points", CLOUD, T0, cloud(wall))])
    beams = np.flatnonzero(np.isfinite(scan.ranges_m))
    angles = scan.angle_min_rad + beams * scan.angle_increment_rad
    x = scan.ranges_m[beams] * np.cos(angles)
    assert np.abs(x - 2.0).max() < 2.0 * scan.angle_increment_rad * math.hypot(2, 3)
    assert len(beams) > 200


def test_a_planar_scan_goes_before_a_cloud(tmp_path):
    scans = some_scans(3, odometry=False)
    messages = [("/points", CLOUD, T0, cloud(ring(4.0, 400, 0.0)))]
    messages += [("/scan", SCAN, scan.stamp_ns, ROS.scan(scan)) for scan in scans]
    found, _ = drive(tmp_path, messages)
    assert_same(found, scans)
    found, _ = drive(tmp_path, messages, topics=("/points",))
    assert len(found) == 1


@pytest.mark.parametrize(
    "changes",
    [
        {"point_step": 4},
        {"point_step": 0},
        {"width": 10**9},
        {"row_step": 1, "height": 2, "width": 200},
        {"fields": []},
        {"data": np.zeros(3, np.uint8)},
    ],
)
def test_clouds_whose_sizes_disagree(tmp_path, changes):
    message = cloud(ring(4.0, 400, 0.0))
    for name, value in changes.items():
        setattr(message, name, value)
    good = cloud(ring(4.0, 400, 0.0))
    found, report = drive(tmp_path, [("/points", CLOUD, T0, good), ("/points", CLOUD, T0, message)])
    assert len(found) == 1
    assert report.scans_skipped == 1


def test_an_unusual_definition_is_followed(tmp_path):
    """Fields in another order, one more and one of another size: the schema in the log decides."""
    store = get_typestore(Stores.EMPTY)
    text = (
        "std_msgs/Header header\nfloat64 range_max\nfloat32 angle_min\nfloat32 angle_max\n"
        "uint8 quality\nfloat32 angle_increment\nfloat32 time_increment\nfloat32 scan_time\n"
        "float32 range_min\nfloat64[] ranges\nfloat32[] intensities\n"
        + "=" * 80
        + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
        + "=" * 80
        + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    )
    store.register(get_types_from_msg(text, SCAN))
    scans = some_scans(20, odometry=False)
    messages = []
    for scan in scans:
        message = store.types[SCAN](
            header=ROS.header(scan.stamp_ns, "laser"),
            range_max=scan.range_max_m,
            angle_min=scan.angle_min_rad,
            angle_max=0.0,
            quality=3,
            angle_increment=scan.angle_increment_rad,
            time_increment=0.0,
            scan_time=0.0,
            range_min=0.0,
            ranges=scan.ranges_m.astype(np.float64),
            intensities=np.zeros(0, np.float32),
        )
        messages.append(("/scan", SCAN, scan.stamp_ns, bytes(store.serialize_cdr(message, SCAN))))
    path = tmp_path / "log.mcap"
    path.write_bytes(ros_mcap(messages, ROS, schemas={SCAN: text.encode()}))
    found, report = read(path)
    assert_same(found, scans)
    assert report.scans_skipped == 0


@pytest.mark.parametrize(
    "changes",
    [
        {"timestamp": {"sec": 10**400, "nsec": 0}},
        {"timestamp": "yesterday"},
        {"ranges": "none"},
        {"ranges": [1.0]},
        {"start_angle": None},
        {"ranges": [[1]]},
        {"pose": 7},
    ],
)
def test_json_that_is_no_scan(tmp_path, changes):
    scans = some_scans(30, odometry=False)
    payloads = [json_scan(scan, **(changes if i == 7 else {})) for i, scan in enumerate(scans)]
    found, report = read(json_log(tmp_path, payloads))
    assert_same(found, scans[:7] + scans[8:])
    assert report.scans_skipped == 1


def test_json_stamps_as_text(tmp_path):
    (scan,) = some_scans(1)
    payload = json_scan(scan, timestamp="2005-12-18T00:23:49.895181952Z")
    assert read(json_log(tmp_path, [payload]))[0][0].stamp_ns == 1134865429895181952


def test_a_pose_in_the_message_is_the_lasers_place(tmp_path):
    (scan,) = some_scans(1)
    pose = {
        "position": {"x": 0.2, "y": 0.1, "z": 0.5},
        "orientation": {"x": 0, "y": 0, "z": 1, "w": 0},
    }
    path = json_log(tmp_path, [json_scan(scan, frame_id="base_link", pose=pose)])
    (found,), report = read(path)
    assert found.pose_base_laser == SE2(0.2, 0.1, math.pi)
    assert report.warnings == []


def json_log(folder, payloads):
    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start()
    schema = writer.register_schema("foxglove.LaserScan", "jsonschema", b"{}")
    channel = writer.register_channel("/scan", "json", schema)
    for stamp, payload in enumerate(payloads, 1):
        writer.add_message(channel, stamp, payload, stamp)
    writer.finish()
    path = folder / "log.mcap"
    path.write_bytes(stream.getvalue())
    return path
