"""Round lengths."""

import pytest

from bsmap_cli.exchange.rounding import round_length


@pytest.mark.parametrize(
    ("length", "rounded"),
    [(1.0, 1.0), (4.99, 2.0), (5.0, 5.0), (0.07, 0.05), (730.0, 500.0), (0.001, 0.001), (1e3, 1e3)],
)
def test_the_greatest_of_1_2_5_that_is_not_longer(length, rounded):
    assert round_length(length) == rounded
