"""Rows of numbers, read as `float` would read their words, or left to it."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from bsmap_cli.logs.canonical import float32_ranges
from bsmap_cli.logs.plain_numbers import plain_numbers

finite = st.floats(allow_nan=False, allow_infinity=False)
spelt = st.one_of(
    finite.map(repr),
    st.integers(-(10**12), 10**12).map(str),
    st.floats(0.0, 100.0).map("{:.2f}".format),
    st.floats(-1e-9, 1e-9).map("{:e}".format),
)


@given(st.lists(spelt, max_size=40), st.sampled_from([" ", ",", ";", "\t"]))
def test_numbers_are_those_that_float_reads(words, separator):
    text = separator.join(words).encode()
    assert plain_numbers(text, separator.encode()) == [float(word) for word in words]


@given(st.text('0123456789+-.eE _naifNI[]{}"tru', max_size=12).map(str.encode))
@example(b"1 2 true")
@example(b"1 null")
@example(b"1 [2]")
@example(b"NaN")
@example(b"1 -Infinity")
@example(b"1e999")
@example(b"-0")
def test_what_it_reads_is_never_something_else(text):
    numbers = plain_numbers(text)
    if numbers is not None and text:
        assert numbers == [float(word) for word in text.split(b" ")]


@pytest.mark.parametrize("text", [b"1.0  2.0", b"1.0 nan", b".5 1", b"+1 2", b"1.0 two", b"007"])
def test_other_spellings_are_left_to_float(text):
    assert plain_numbers(text) is None


def test_no_text_holds_no_number():
    assert plain_numbers(b"") == []


@given(st.lists(st.one_of(st.floats(), st.integers(-(10**30), 10**30)), max_size=20))
@example([1e39, -1e39, float("nan"), 16777217, 3.4028235e38, 1e-46])
def test_ranges_become_float32_as_numpy_rounds(numbers):
    with np.errstate(over="ignore", invalid="ignore"):
        expected = np.array(numbers, np.float64).astype(np.float32)
    found = float32_ranges(numbers)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(float32_ranges(np.array(numbers, np.float64)), expected)
