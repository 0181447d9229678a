"""Pictures: the curves stand where they should, to scale, and the bytes do not change."""

import io

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from PIL import Image

from bsmap_cli.errors import LogError, UsageError
from bsmap_cli.evaluation.trajectory_error import absolute_error, match_poses
from bsmap_cli.mapping.map_document import MapDocument
from bsmap_cli.plotting import plot_error, plot_map, save_figure
from bsmap_cli.plotting.figures import DARK, LIGHT
from bsmap_cli.sensor.trajectory import Trajectory
from tests.maps import line_points, make_level, room_document


def saved(figure, format_):
    stream = io.BytesIO()
    save_figure(figure, stream, format_)
    return stream.getvalue()


def pixels(figure):
    return np.asarray(Image.open(io.BytesIO(saved(figure, "png"))).convert("RGB")) / 255.0


def pixel_of(figure, point, image):
    column, row = figure.axes[0].transData.transform(point)
    return image[round(image.shape[0] - row), round(column)]


def darkest_at(figure, point, image):
    column, row = figure.axes[0].transData.transform(point)
    top, left = round(image.shape[0] - row), round(column)
    return image[top - 1 : top + 2, left - 1 : left + 2].min()


def path():
    t = np.linspace(0.0, 4.0, 50)
    poses = np.column_stack((1.0 + t, 1.0 + 0.5 * np.sin(t), 0.1 * t))
    return Trajectory((t * 1e9).astype(np.int64), poses)


@pytest.mark.parametrize("format_", ["png", "svg", "pdf"])
@pytest.mark.parametrize("colour_by", ["weight", "curve", "level"])
def test_the_same_map_gives_the_same_bytes(format_, colour_by):
    first, second = (
        saved(plot_map(room_document(), colour_by=colour_by, trajectory=path()), format_)
        for _ in range(2)
    )
    assert first == second
    assert b"Date" not in first


@pytest.mark.parametrize("width", [None, 333, 700, 1400, 1401])
@pytest.mark.parametrize("clip", [None, (-0.5, -0.7, 6.31, 4.77)])
def test_a_picture_is_as_wide_as_asked_for(width, clip):
    figure = plot_map(room_document(with_path=False), clip=clip)
    stream = io.BytesIO()
    save_figure(figure, stream, "png", width_px=width)
    picture = Image.open(stream)
    assert abs(picture.width - (width or 2000)) <= 1
    assert picture.mode == "P"
    image = np.asarray(picture.convert("RGB")) / 255.0
    for point in ((3.0, 0.0), (6.0, 2.0), (3.0, 4.0), (0.0, 2.0), (3.5, 2.0)):
        assert darkest_at(figure, point, image) < 0.9, point
    for point in ((1.0, 1.0), (4.0, 2.0), (3.0, 3.8)):
        assert darkest_at(figure, point, image) > 0.98, point


def test_walls_are_where_they_are_and_ground_elsewhere():
    for dark, theme in ((False, LIGHT), (True, DARK)):
        figure = plot_map(room_document(with_path=False), dark=dark)
        image = pixels(figure)
        ground = to_rgb(theme.ground)
        for point in ((3.0, 0.0), (6.0, 2.0), (3.0, 4.0), (0.0, 2.0), (3.5, 2.0)):
            assert np.abs(pixel_of(figure, point, image) - ground).max() > 0.2, point
        for point in ((1.0, 1.0), (4.0, 2.0), (3.0, 3.9)):
            np.testing.assert_allclose(pixel_of(figure, point, image), ground, atol=0.01)


def test_both_axes_have_one_scale():
    axes = plot_map(room_document()).axes[0]
    (x0, y0), (x1, y1) = axes.transData.transform([(0, 0), (1, 1)])
    assert x1 - x0 == pytest.approx(y1 - y0)


def test_the_scale_bar_is_as_long_as_it_says():
    figure = plot_map(room_document())
    axes, footer = figure.axes[:2]
    (label,) = [text.get_text() for text in footer.texts]
    pixels_per_metre = np.diff(axes.transData.transform([(0, 0), (1, 0)])[:, 0])[0]
    bar = footer.transData.transform(footer.lines[0].get_xydata())[:, 0]
    assert label == "1 m"
    assert np.ptp(bar) / pixels_per_metre == pytest.approx(1.0)


def test_control_points_and_knots_are_marked():
    document = room_document(with_path=False)
    figure = plot_map(document, control_points=True, knots=True)
    marks = [line.get_xydata() for line in figure.axes[0].lines][::-1]
    np.testing.assert_allclose(marks[0], document.finest.control_points)
    # a wall of 6 m at 0.1 m has 61 control points and 58 spans between 59 knots
    on_first_wall = marks[1][marks[1][:, 1] == 0.0]
    np.testing.assert_allclose(on_first_wall[:, 0], np.arange(1, 60) * 0.1, atol=1e-6)


def test_a_reference_in_another_frame_is_drawn_over_the_path():
    trajectory = path()
    cos, sin = np.cos(1.0), np.sin(1.0)
    moved = trajectory.poses[:, :2] @ np.array([[cos, sin], [-sin, cos]]) + [20.0, -7.0]
    reference = Trajectory(
        trajectory.stamps_ns, np.column_stack((moved, trajectory.poses[:, 2] + 1.0))
    )
    figure = plot_map(room_document(), trajectory=trajectory, reference=reference)
    drawn = figure.axes[0].lines[0].get_xydata()
    np.testing.assert_allclose(drawn, trajectory.poses[:, :2], atol=1e-9)


def test_levels_and_overlay():
    coarse = make_level([line_points((0, 0), (4, 0), 0.4)], 0.4)
    fine = make_level([line_points((0, 1), (4, 1), 0.1)], 0.1)
    document = MapDocument(degree=3, max_weight=50, levels=(coarse, fine))
    count = {None: 1, 0.4: 1, 0.1: 1}
    for level, lines in count.items():
        assert len(plot_map(document, level=level).axes[0].collections) == lines
    assert len(plot_map(document, colour_by="level").axes[0].collections) == 2
    assert len(plot_map(document, overlay=room_document()).axes[0].collections) == 2
    with pytest.raises(UsageError, match=r"no level of knot step 0.2 m: it has 0.4, 0.1"):
        plot_map(document, level=0.2)


def test_the_second_map_is_in_the_picture_and_named():
    far = make_level([line_points((20, 8), (24, 8), 0.1)], 0.1)
    second = MapDocument(degree=3, max_weight=50, levels=(far,))
    figure = plot_map(room_document(), overlay=second, names=("old.bsm", "new.bsm"))
    axes, footer = figure.axes[:2]
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    assert x0 < 0.0 < 24.0 < x1
    assert y0 < 0.0 < 8.0 < y1
    assert [text.get_text() for text in footer.get_legend().texts] == ["old.bsm", "new.bsm"]
    image = pixels(figure)
    np.testing.assert_allclose(
        pixel_of(figure, (22.0, 8.0), image), to_rgb(LIGHT.overlay), atol=0.05
    )


def test_a_clip_shows_that_box_alone():
    axes = plot_map(room_document(), clip=(1.0, 0.5, 4.0, 2.5)).axes[0]
    assert (*axes.get_xlim(), *axes.get_ylim()) == (1.0, 4.0, 0.5, 2.5)


@pytest.mark.parametrize("dark", [False, True])
def test_the_error_stands_out_from_the_ground(dark):
    trajectory = path()
    figure = plot_map(
        room_document(), trajectory=trajectory, reference=trajectory, colour_by="curve", dark=dark
    )
    (error,) = [c for c in figure.axes[0].collections if c.get_array() is not None]
    ground = np.array(to_rgb((DARK if dark else LIGHT).ground))
    for share in np.linspace(0.0, 1.0, 20):
        assert np.abs(np.array(error.cmap(share)[:3]) - ground).max() > 0.35
    assert [text.get_text() for text in figure.axes[1].get_legend().texts] == ["reference"]


def test_marks_leave_room_between_the_knots():
    document = room_document(with_path=False)
    for clip in (None, (0.0, 0.0, 1.0, 1.0), (-200.0, -200.0, 200.0, 200.0)):
        figure = plot_map(document, control_points=True, clip=clip)
        axes = figure.axes[0]
        step = np.diff(axes.transData.transform([(0, 0), (0.1, 0)])[:, 0])[0] * 72 / figure.dpi
        assert axes.lines[-1].get_markersize() <= max(0.5 * step, 1.0)


def test_an_empty_map_is_a_picture_too():
    document = MapDocument(degree=3, max_weight=50, levels=(make_level([]),))
    assert saved(plot_map(document), "png").startswith(b"\x89PNG")


def test_error_over_time():
    trajectory = path()
    off = Trajectory(trajectory.stamps_ns, trajectory.poses + np.array([0.0, 0.0, 0.01]))
    error = absolute_error(match_poses(off, trajectory))
    figure = plot_error(error)
    assert [axes.get_ylabel() for axes in figure.axes] == ["translation [m]", "rotation [deg]"]
    seconds, values = figure.axes[1].lines[0].get_data()
    np.testing.assert_allclose(seconds[[0, -1]], [0.0, 4.0])
    np.testing.assert_allclose(values, error.rotation_deg)
    late = Trajectory(trajectory.stamps_ns + 10**12, trajectory.poses)
    with pytest.raises(LogError, match="no poses within"):
        plot_map(room_document(), trajectory=trajectory, reference=late)
