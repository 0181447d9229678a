"""Varints beside a decoder of one byte at a time."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsmap_cli.mapping.varints import (
    decode_varints,
    encode_varints,
    segmented_differences,
    segmented_sums,
    unzigzag,
    zigzag,
)
from tests.mapping import plain_reader

edges = st.sampled_from([0, 127, 128, 16383, 16384, 2**63, 2**64 - 1, 2**56 - 1, 2**56])


@given(st.lists(edges | st.integers(0, 2**64 - 1) | st.integers(0, 300)))
def test_unsigned_values(values):
    data = encode_varints(np.array(values, np.uint64))
    assert plain_reader.varints(data) == values
    assert decode_varints(data, len(values)).tolist() == values


@given(st.lists(st.integers(-(2**63), 2**63 - 1)))
def test_signed_values(values):
    folded = zigzag(np.array(values, np.int64))
    assert plain_reader.zigzag(encode_varints(folded)) == values
    assert unzigzag(folded).tolist() == values


def test_small_magnitudes_are_short():
    assert zigzag(np.array([0, -1, 1, -2, 2])).tolist() == [0, 1, 2, 3, 4]


@given(st.lists(st.lists(st.integers(-1000, 1000), min_size=1), max_size=5))
def test_differences_and_sums_begin_anew_in_each_segment(segments):
    values = np.array([value for segment in segments for value in segment], np.int64)
    lengths = np.array([len(segment) for segment in segments], np.int64)
    firsts = np.cumsum(lengths) - lengths
    differences = segmented_differences(values, firsts)
    expected = [np.diff(segment, prepend=0).tolist() for segment in segments]
    assert differences.tolist() == [value for segment in expected for value in segment]
    assert segmented_sums(differences, firsts).tolist() == values.tolist()


@pytest.mark.parametrize(
    ("data", "count"),
    [
        (b"", 1),
        (b"\x80", 1),
        (b"\x01\x80", 1),
        (b"\x01", 2),
        (b"\x01\x02", 1),
        (b"\x80" * 10 + b"\x01", 1),
    ],
)
def test_streams_that_hold_something_else(data, count):
    with pytest.raises(ValueError, match="varints"):
        decode_varints(data, count)
