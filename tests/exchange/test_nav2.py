"""The nav2 pair, loaded by an independent reader under nav2's own rules."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from bsmap_cli.errors import UsageError
from bsmap_cli.evaluation.occupancy import FREE, OCCUPIED
from bsmap_cli.exchange.nav2 import selected_occupancy, write_nav2_yaml, write_pgm
from bsmap_cli.exchange.selection import select
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.sensor.trajectory import Trajectory
from tests.exchange.exported import densely, drawn_lines, written
from tests.maps import make_level, room_document


def load(folder: Path):
    """The map as nav2's server loads it in trinary mode: 100 occupied, 0 free, -1 unknown."""
    about = yaml.safe_load((folder / "map.yaml").read_text())
    assert about["mode"] == "trinary"
    kind, size, depth, pixels = (folder / about["image"]).read_bytes().split(b"\n", 3)
    assert (kind, depth) == (b"P5", b"255")
    columns, rows = map(int, size.split())
    shade = np.frombuffer(pixels, np.uint8).reshape(rows, columns) / 255.0
    occupied = shade if about["negate"] else 1.0 - shade
    grid = np.full((rows, columns), -1)
    grid[occupied > about["occupied_thresh"]] = 100
    grid[occupied < about["free_thresh"]] = 0
    return grid[::-1], about["origin"], about["resolution"]


def pair(folder, document, *, resolution_m=0.05, **options):
    grid = selected_occupancy(select(document, **options), resolution_m=resolution_m)
    (folder / "map.pgm").write_bytes(written(write_pgm, grid))
    (folder / "map.yaml").write_bytes(written(write_nav2_yaml, grid, "map.pgm"))
    return grid


@pytest.mark.parametrize("resolution_m", [0.05, 0.02, 0.1])
def test_what_nav2_loads_is_the_map(tmp_path, resolution_m):
    document = room_document()
    pair(tmp_path, document, resolution_m=resolution_m)
    grid, (x, y, yaw), resolution = load(tmp_path)
    assert (resolution, yaw) == (resolution_m, 0.0)

    def state(points):
        column, row = ((np.asarray(points) - [x, y]) / resolution).astype(int).T
        return grid[row, column]

    # away from the borders of cells each point of a curve is in an occupied cell
    on_curves = np.concatenate([densely(line) for line in drawn_lines(document.finest)])
    phase = np.mod((on_curves - [x, y]) / resolution, 1.0)
    sure = (np.abs(phase - 0.5) < 0.4).all(axis=1)
    assert (state(on_curves[sure]) == 100).all()
    assert (state([[1.0, 2.0], [2.0, 1.0], [5.0, 3.5]]) == 0).all()
    assert (state([[4.0, 2.0], [-0.3, 2.0], [3.0, 4.3]]) == -1).all()


def test_free_space_of_a_trajectory(tmp_path):
    behind = Trajectory(np.array([1]), np.array([[5.5, 2.0, 0.0]]))
    without, given = (
        pair(tmp_path, room_document(with_path=False), trajectory=t) for t in (None, behind)
    )
    assert not (without.cells == FREE).any()
    assert (given.cells == FREE).any()
    assert ((without.cells == OCCUPIED) == (given.cells == OCCUPIED)).all()


def test_a_clip_crops_the_grid_and_changes_no_cell(tmp_path):
    whole = pair(tmp_path, room_document())
    grid = pair(tmp_path, room_document(), clip=(2.0, 1.0, 5.0, 3.0))
    assert grid.cells.shape == (40, 60)
    assert (grid.frame.x_m, grid.frame.y_m) == (pytest.approx(2.0), pytest.approx(1.0))
    np.testing.assert_array_equal(grid.cells, whole.cells[30:70, 50:110])
    found, (x, y, _), _ = load(tmp_path)
    assert found.shape == (40, 60)
    assert (x, y) == (grid.frame.x_m, grid.frame.y_m)


def test_nothing_to_draw_is_said():
    empty = MapDocument(degree=3, max_weight=50, levels=(make_level([]),))
    for document, clip in ((empty, None), (room_document(), (50.0, 50.0, 51.0, 51.0))):
        with pytest.raises(UsageError, match="nothing to put into a grid"):
            selected_occupancy(select(document, clip=clip))


def test_the_origin_keeps_all_digits_and_a_name_is_quoted(tmp_path):
    grid = pair(tmp_path, room_document())
    about = yaml.safe_load(written(write_nav2_yaml, grid, "it's: #1.pgm"))
    assert about["image"] == "it's: #1.pgm"
    assert about["origin"] == [grid.frame.x_m, grid.frame.y_m, 0.0]
    assert about["free_thresh"] == 0.196
