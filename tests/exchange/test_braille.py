"""The picture in the terminal, read back dot by dot."""

import numpy as np
import pytest

from bsmap_cli.exchange.braille import braille_map
from tests.exchange.exported import distances, drawn_lines
from tests.maps import line_points, make_level, room_document

# dots of a braille letter in the order of its bits: column, row
ORDER = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3)]


def dots(lines):
    return np.array(
        [
            (2 * c + dx, 4 * r + dy)
            for r, line in enumerate(lines)
            for c, letter in enumerate(line)
            for bit, (dx, dy) in enumerate(ORDER)
            if (ord(letter) - 0x2800) >> bit & 1
        ]
    )


def test_dots_lie_on_the_curves_and_curves_on_dots():
    level = room_document().finest
    picture = braille_map([level], columns=40, rows=20)
    lines = picture.lines
    assert picture.letter_m == pytest.approx(2 * 6.0 / 79)
    assert len(lines) <= 20
    assert max(map(len, lines)) == 40
    found = dots(lines)
    size = 6.0 / 79
    points = np.column_stack((found[:, 0] * size, 4.0 - found[:, 1] * size))
    assert distances(points, drawn_lines(level)).max() < size
    assert (
        distances(np.concatenate(drawn_lines(level)), points[:, None] + [[0, 0], [0, 1e-9]]).max()
        < size
    )


def test_y_points_up():
    level = make_level([line_points((0, 0), (2, 2), 0.1)])
    found = dots(braille_map([level], columns=10, rows=10).lines)
    assert np.corrcoef(found.T)[0, 1] < -0.99


def test_tall_maps_keep_within_the_rows():
    level = make_level([line_points((0, 0), (0, 30), 0.1)])
    lines = braille_map([level], columns=40, rows=8).lines
    assert len(lines) == 8
    assert all(line == lines[0] for line in lines)


def test_nothing_drawn_no_lines():
    assert braille_map([make_level([])]).lines == []
