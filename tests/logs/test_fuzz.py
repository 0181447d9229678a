"""Bytes of any kind into the decoders: a record or a refusal, never a foreign error."""

import contextlib

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from bsmap_cli.errors import BsmapError
from bsmap_cli.logs.decoding import decoder_for, kind_of
from bsmap_cli.logs.messages import BadMessageError, Channel
from tests.logs.making import (
    ODOM,
    SCAN,
    TF,
    Ros,
    carmen,
    csv,
    field,
    json_scan,
    planar,
    read,
    ros_mcap,
    schema_of,
    some_scans,
)

SCANS = some_scans(4, 9)
SCENARIOS = {}
for is_ros1 in (False, True):
    ros = Ros(is_ros1=is_ros1)
    stamp = SCANS[0].stamp_ns
    transforms = ros.transforms(planar(stamp, "a", "b", SCANS[1].pose_odom_base))
    for type_name, message in (
        (SCAN, ros.scan(SCANS[0])),
        (ODOM, ros.odometry(stamp, SCANS[1].pose_odom_base)),
        (TF, transforms),
    ):
        schema_encoding, schema = schema_of(type_name, "ros2msg", is_ros1)
        channel = Channel(
            topic="/x",
            type=type_name,
            encoding="ros1" if is_ros1 else "cdr",
            schema_encoding=schema_encoding,
            schema=schema,
        )
        SCENARIOS[f"{channel.encoding} {type_name}"] = (channel, ros.bytes_of(message, type_name))
SCENARIOS["json scan"] = (
    Channel(topic="/x", type="foxglove.LaserScan", encoding="json"),
    json_scan(SCANS[0]),
)
SCENARIOS["protobuf scan"] = (
    Channel(topic="/x", type="foxglove.LaserScan", encoding="protobuf"),
    field(2, "laser") + field(4, -1.0) + field(5, 1.0) + field(6, np.arange(9.0).tobytes()),
)

DECODERS = {name: decoder_for(made, last_echo=False) for name, (made, _) in SCENARIOS.items()}
HOW = st.sampled_from(("set", "cut", "insert"))
edits = st.lists(
    st.tuples(st.integers(0, 10**6), HOW, st.binary(max_size=9)), min_size=1, max_size=6
)


def edited(data, changes):
    data = bytearray(data)
    for place, how, new in changes:
        at = place % (len(data) + 1)
        if how == "set":
            data[at : at + len(new)] = new
        elif how == "insert":
            data[at:at] = new
        else:
            del data[at : at + len(new)]
    return bytes(data)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_whole_messages_are_decoded(scenario):
    channel, payload = SCENARIOS[scenario]
    assert kind_of(channel) is not None
    assert decoder_for(channel, last_echo=False)(payload)


@pytest.mark.parametrize("scenario", SCENARIOS)
@settings(max_examples=150, deadline=None)
@given(changes=edits)
def test_damaged_messages(scenario, changes):
    _, payload = SCENARIOS[scenario]
    try:
        DECODERS[scenario](edited(payload, changes))
    except BadMessageError as error:
        assert len(str(error)) < 500


@settings(max_examples=60, deadline=None)
@given(schema=st.one_of(st.binary(max_size=200), edits))
@example(schema=b"sensor_msgs/LaserScan scan")
@example(schema=b"std_msgs/Header header\nstring<=5 ranges\nwstring x\nfloat32[<=3] angle_min")
def test_damaged_schemas(schema):
    channel, payload = SCENARIOS[f"cdr {SCAN}"]
    if not isinstance(schema, bytes):
        schema = edited(channel.schema, schema)
    wrong = Channel(topic="/x", type=SCAN, encoding="cdr", schema_encoding="ros2msg", schema=schema)
    with contextlib.suppress(BadMessageError):
        decoder_for(wrong, last_echo=False)(payload)


WHOLE = {
    "mcap": ros_mcap(
        [("/scan", SCAN, scan.stamp_ns, Ros().scan(scan)) for scan in SCANS], Ros(), chunk_size=500
    ),
    "carmen": carmen(SCANS),
    "csv": csv(SCANS),
}


@pytest.mark.parametrize("kind", WHOLE)
@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(changes=edits)
def test_damaged_logs(kind, changes, tmp_path):
    path = tmp_path / "log"
    path.write_bytes(edited(WHOLE[kind], changes))
    try:
        found, report = read(path)
    except BsmapError:
        return
    assert len(found) == report.scans_read
    for scan in found:
        assert scan.ranges_m.dtype == np.float32
        assert scan.angle_increment_rad > 0.0
        assert np.isfinite(scan.angle_min_rad)
        assert abs(scan.stamp_ns) < 2**63
        if scan.pose_odom_base is not None:
            assert np.isfinite(scan.pose_odom_base.as_array()).all()
