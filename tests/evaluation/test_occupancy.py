"""The grid of a map: what is occupied, what the path has seen, and the PNG of it."""

import io

import numpy as np
import pytest
from PIL import Image

from bsmap_cli.errors import UsageError
from bsmap_cli.evaluation.occupancy import (
    FREE,
    OCCUPIED,
    UNKNOWN,
    grid_frame,
    occupancy,
    trinary_png,
)
from bsmap_cli.mapping.sampling import sample_level
from tests.maps import arc_points, line_points, make_level

NO_PATH = np.zeros((0, 2))


WIDTH, HEIGHT = 6.02, 4.03  # no multiples of the cells, so that no wall flickers between two


def closed_room():
    """Walls that cross at the corners, and a pillar; curves are drawn 0.1 m short of their ends."""
    walls = [
        line_points((-0.1, 0.0), (WIDTH + 0.2, 0.0), 0.1),
        line_points((WIDTH, -0.1), (WIDTH, HEIGHT + 0.2), 0.1),
        line_points((WIDTH + 0.1, HEIGHT), (-0.2, HEIGHT), 0.1),
        line_points((0.0, HEIGHT + 0.1), (0.0, -0.2), 0.1),
    ]
    pillar = arc_points((4.0, 2.0), 0.5, 2 * np.pi + 0.4, 0.0, 0.1)
    return make_level([*walls, pillar])


def room(path=((1.0, 1.0),), **options):
    return occupancy([closed_room()], np.array(path), **options)


def centres(grid):
    row, column = np.indices(grid.cells.shape)
    frame = grid.frame
    return (
        frame.x_m + (column + 0.5) * frame.resolution_m,
        frame.y_m + (row + 0.5) * frame.resolution_m,
    )


def test_the_grid_is_the_bounding_box_grown_by_half_a_metre():
    frame = grid_frame(np.array([[0.0, 0.0], [6.0, 4.0]]))
    assert (frame.columns, frame.rows, frame.cells) == (140, 100, 14000)
    assert (frame.x_m, frame.y_m) == (-0.5, -0.5)


def test_each_sample_of_a_curve_lies_in_an_occupied_cell_and_no_cell_is_far_from_one():
    grid = room(NO_PATH)
    samples = sample_level(closed_room(), 0.002).points
    column, row = np.floor(grid.frame.in_cells(samples)).astype(int).T
    near = np.zeros(grid.cells.shape, bool)
    near[row, column] = True
    # coarser sampling may cut a corner of a cell
    assert np.count_nonzero(grid.cells[row, column] != OCCUPIED) < 0.02 * len(row)
    x, y = (c[grid.cells == OCCUPIED] for c in centres(grid))
    gap = [np.hypot(samples[:, 0] - a, samples[:, 1] - b).min() for a, b in zip(x, y, strict=True)]
    assert max(gap) < 0.05
    assert set(np.unique(grid.cells)) == {OCCUPIED, UNKNOWN}


def hidden_by_pillar(view, x, y, slack):
    """Whether the straight way from the view to (x, y) passes the pillar's disc."""
    centre, radius = np.array([4.0, 2.0]), 0.5 + slack
    way = np.stack((x - view[0], y - view[1]), axis=-1)
    along = np.clip((way @ (centre - view)) / np.maximum((way**2).sum(-1), 1e-12), 0, 1)
    foot = view + along[..., None] * way
    return np.hypot(*(np.moveaxis(foot, -1, 0) - centre[:, None, None])) < radius


@pytest.mark.parametrize("view", [(1.0, 1.0), (2.5, 3.0), (4.0, 3.2)])
def test_free_is_what_is_seen_from_the_path(view):
    grid = room([view])
    x, y = centres(grid)
    view = np.array(view)
    depth = np.minimum(np.minimum(x, WIDTH - x), np.minimum(y, HEIGHT - y))  # inside the walls
    sure = (depth > 0.1) & ~hidden_by_pillar(view, x, y, 0.15)
    assert (grid.cells[sure] == FREE).mean() > 0.999
    hidden = (depth > 0.1) & hidden_by_pillar(view, x, y, -0.12)
    assert not (grid.cells[hidden] == FREE).any()
    assert not (grid.cells[depth < -0.05] == FREE).any()


def test_more_views_see_round_the_pillar():
    seen = [np.count_nonzero(room(path).cells == FREE) for path in ([(1, 2)], [(1, 2), (5.5, 2)])]
    assert seen[1] > seen[0]


def test_behind_a_wall_nothing_is_free():
    # seen from its right-hand side: the wall's back
    wall = make_level([line_points((0, 0), (4, 0), 0.1)])
    assert not (occupancy([wall], np.array([[2.0, -0.4]])).cells == FREE).any()
    assert (occupancy([wall], np.array([[2.0, 0.4]])).cells == FREE).any()


def test_out_of_range_nothing_is_free():
    assert (room(range_max_m=0.9).cells == FREE).sum() == 0
    assert 0 < (room(range_max_m=1.5).cells == FREE).sum() < (room().cells == FREE).sum()


def quarter_turned(level):
    points = np.column_stack((-level.control_points[:, 1], level.control_points[:, 0]))
    names = set(level.__slots__) - {"control_points"}
    return type(level)(control_points=points, **{name: getattr(level, name) for name in names})


def test_a_map_turned_by_a_quarter_has_the_same_grid_turned():
    grid = occupancy([closed_room()], np.array([[1.0, 1.0]]))
    turned = occupancy([quarter_turned(closed_room())], np.array([[-1.0, 1.0]]))
    for state in (FREE, OCCUPIED):
        # borders of cells fall elsewhere
        assert (turned.cells == state).sum() == pytest.approx((grid.cells == state).sum(), rel=0.03)


def test_a_grid_worked_on_a_few_rows_at_a_time_is_the_same(monkeypatch):
    whole = room(((1.0, 1.0), (4.0, 3.2)))
    picture = trinary_png(whole.cells)
    monkeypatch.setattr("bsmap_cli.evaluation.visibility.CELLS_AT_ONCE", 1000)
    in_parts = room(((1.0, 1.0), (4.0, 3.2)))
    np.testing.assert_array_equal(in_parts.cells, whole.cells)
    assert trinary_png(in_parts.cells) == picture


def test_an_empty_map_has_an_empty_grid():
    assert occupancy([make_level([])], np.zeros((1, 2))).cells.shape == (0, 0)


def test_a_grid_that_does_not_fit_is_refused_with_the_remedy():
    far = make_level(
        [line_points((0, 0), (1, 0), 0.1), line_points((9e3, 9e3), (9e3, 9e3 + 1), 0.1)]
    )
    with pytest.raises(UsageError, match=r"choose cells larger than 0.05 m"):
        occupancy([far], NO_PATH)


@pytest.mark.parametrize("width", [1, 2, 3, 4, 141])
def test_png_is_read_by_others(width):
    cells = np.random.default_rng(0).choice([OCCUPIED, UNKNOWN, FREE], (7, width)).astype(np.uint8)
    image = Image.open(io.BytesIO(trinary_png(cells)))
    shades = np.asarray(image.convert("L"))
    expected = {OCCUPIED: 0, UNKNOWN: 85, FREE: 255}
    np.testing.assert_array_equal(shades, np.vectorize(expected.get)(cells[::-1]))
