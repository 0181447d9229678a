"""TUM files: exact stamps, and poses back to a nanometre."""

import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsmap_cli.errors import LogError
from bsmap_cli.exchange.tum import read_tum, write_tum
from bsmap_cli.sensor.stamps import format_stamp, parse_stamp
from bsmap_cli.sensor.trajectory import Trajectory

stamps = st.integers(-(2**63) + 1, 2**63 - 1)


@given(stamps)
def test_stamps_come_back_exactly(stamp_ns):
    assert parse_stamp(format_stamp(stamp_ns)) == stamp_ns


@pytest.mark.parametrize(
    ("text", "stamp_ns"),
    [
        ("976052857.338", 976052857_338000000),
        ("1.305031910765e+09", 1305031910_765000000),
        ("-0.000000001", -1),
        ("3", 3_000000000),
        ("0.1234567894", 123456789),
    ],
)
def test_known_stamps(text, stamp_ns):
    assert parse_stamp(text) == stamp_ns


@pytest.mark.parametrize("text", ["", "nan", "inf", "1e30", "1e999999999", "12:30", "abc"])
def test_what_is_no_stamp(text):
    with pytest.raises(ValueError, match=r"is not a time|does not fit"):
        parse_stamp(text)


@given(
    st.lists(
        st.tuples(stamps, st.floats(-1e4, 1e4), st.floats(-1e4, 1e4), st.floats(-3.14, 3.14)),
        max_size=5,
    )
)
def test_round_trip(rows):
    trajectory = Trajectory(
        np.array([row[0] for row in rows], np.int64),
        np.array([row[1:] for row in rows]).reshape(-1, 3),
    )
    stream = io.StringIO()
    write_tum(stream, trajectory)
    back = read_tum(io.StringIO(stream.getvalue()))
    np.testing.assert_array_equal(back.stamps_ns, trajectory.stamps_ns)
    np.testing.assert_allclose(back.poses, trajectory.poses, rtol=0, atol=3e-9)


def test_the_line_itself():
    stream = io.StringIO()
    write_tum(stream, Trajectory(np.array([1_000000007]), np.array([[1.5, -2.0, np.pi / 2]])))
    line = "1.000000007 1.500000000 -2.000000000 0 0 0 0.707106781 0.707106781\n"
    assert stream.getvalue() == line


def test_yaw_of_a_tilted_quaternion_of_any_length():
    # yaw 0.5 after roll 0.2, quaternion twice as long as it should be
    w, x, y, z = (
        np.cos(0.25) * np.cos(0.1),
        np.cos(0.25) * np.sin(0.1),
        np.sin(0.25) * np.sin(0.1),
        np.sin(0.25) * np.cos(0.1),
    )
    line = f"1 0 0 0 {2 * x} {2 * y} {2 * z} {2 * w}"
    assert read_tum([line]).poses[0, 2] == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize(
    "line", ["1 2 3", "1 2 3 4 5 6 7 8 9", "a 0 0 0 0 0 0 1", "1 nan 0 0 0 0 0 1"]
)
def test_a_bad_line_is_named(line):
    with pytest.raises(LogError, match="line 3"):
        read_tum(["# comment\n", "1 0 0 0 0 0 0 1\n", line + "\n"])
