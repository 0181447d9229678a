"""A map and the paths through it, to scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, Normalize, to_hex
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bsmap_cli.evaluation.pose_arrays import transform_poses
from bsmap_cli.evaluation.trajectory_error import absolute_error, match_poses
from bsmap_cli.geometry.se2 import Points
from bsmap_cli.mapping.map_document import MapDocument, MapLevel
from bsmap_cli.mapping.sampling import drawn_pieces, evaluate, sample_level
from bsmap_cli.plotting.figures import (
    WIDTH_INCH,
    Bounds,
    Sheet,
    Theme,
    draw_colour_bar,
    draw_names,
    draw_scale_bar,
    map_sheet,
    theme_of,
)
from bsmap_cli.sensor.trajectory import Trajectory

MARGIN = 0.04  # of the longer side
WEIGHT_CLASSES = 8
CURVE_WIDTH_PT, PATH_WIDTH_PT = 1.1, 0.6
MARKS_PT = (0.8, 5.0)
SAMPLES_PER_SPAN = 8
MOST_SAMPLES = 4_000_000
MATCH_S = 0.1


def plot_map(
    document: MapDocument,
    *,
    trajectory: Trajectory | None = None,
    reference: Trajectory | None = None,
    overlay: MapDocument | None = None,
    names: tuple[str, str] = ("map", "overlay"),
    level: float | None = None,
    clip: Bounds | None = None,
    colour_by: str = "weight",
    dark: bool = False,
    control_points: bool = False,
    knots: bool = False,
) -> Figure:
    """A picture of the map, to scale, with a scale bar.

    trajectory : drawn over the map; the map's own thinned path where it is None.
    reference : drawn aligned to the trajectory, which is then coloured by its distance from it.
    overlay : a second map in another colour; both are then drawn plain, and told apart by `names`.
    level : knot step [m] to draw; otherwise the finest, or all that are parts of one map.
    clip : show only this box x0, y0, x1, y1 [m].
    colour_by : "weight" (observations), "curve", or "level" (all levels).
    control_points, knots : mark them.

    UsageError where the map has no such level, LogError where the trajectories do not match.
    """
    theme = theme_of(dark)
    every_level = colour_by == "level" and level is None
    levels = document.levels if every_level else document.chosen_levels(level)
    path = document.path[:, :2].astype(float) if trajectory is None else trajectory.poses[:, :2]
    below = overlay.chosen_levels(level) if overlay is not None else ()
    clouds = [] if clip else [_corners(each) for each in (*levels, *below)]
    sheet = map_sheet(clip or _bounds([*clouds, path]), theme)
    axes = sheet.axes
    if overlay is not None:
        for each in below:
            _add_lines(axes, _polylines(each), theme.overlay)
        for each in levels:
            _add_lines(axes, _polylines(each), theme.ink)
        for name, colour in zip(names, (theme.ink, theme.overlay), strict=True):
            sheet.footer.plot([], [], color=colour, lw=2.0, label=name)
        draw_names(sheet, centre=0.75)
    else:
        _draw_levels(sheet, levels, colour_by, document.max_weight)
        _draw_legend(sheet, levels, colour_by, document.max_weight)
    for each in levels:
        size = _mark_size(sheet, each)
        if knots:
            style: dict[str, Any] = {"ms": size, "mew": min(0.2 * size, 0.6), "zorder": 3}
            axes.plot(*_knots(each).T, "x", color=theme.ink, **style)
        if control_points:
            axes.plot(*each.control_points.T, ".", color=theme.path, ms=size, mew=0, zorder=3)
    if trajectory is not None and reference is not None:
        _draw_compared(sheet, trajectory, reference)
    elif len(path):
        axes.plot(*path.T, color=theme.path, lw=PATH_WIDTH_PT, zorder=4)
        axes.plot(*path[0], "o", color=theme.path, ms=4.0, mew=0, zorder=4)
    draw_scale_bar(sheet)
    return sheet.figure


def _bounds(clouds: list[Points]) -> Bounds:
    points = np.concatenate(clouds)
    if not len(points):
        return -1.0, -1.0, 1.0, 1.0
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    margin = max(MARGIN * max(x1 - x0, y1 - y0), 1e-3)
    return float(x0 - margin), float(y0 - margin), float(x1 + margin), float(y1 + margin)


def _corners(level: MapLevel) -> Points:
    corners = [np.zeros((0, 2))]
    for _, part in level.portions():
        points = sample_level(part, level.knot_step_m).points
        if len(points):
            corners += [points.min(axis=0)[None], points.max(axis=0)[None]]
    return np.concatenate(corners)


def _spacing_m(level: MapLevel) -> float:
    """Between samples; in a map so large that a span is less than a pixel, more than a span."""
    wanted = SAMPLES_PER_SPAN * len(level.weights)
    return level.knot_step_m / SAMPLES_PER_SPAN * max(1.0, wanted / MOST_SAMPLES)


def _polylines(level: MapLevel) -> list[Points]:
    """The drawn pieces as polylines, in the order of `drawn_pieces`."""
    samples = sample_level(level, _spacing_m(level))
    if not len(samples.piece):
        return []
    return np.split(samples.points, np.flatnonzero(np.diff(samples.piece)) + 1)


def _polylines_by_weight(
    level: MapLevel, max_weight: int
) -> tuple[list[Points], NDArray[np.int64]]:
    """The same, cut further where the class of the weight changes, and the class of each."""
    samples = sample_level(level, _spacing_m(level))
    if not len(samples.piece):
        return [], np.zeros(0, np.int64)
    share = (samples.weight - 1.0) / max(max_weight - 1, 1)
    kind = np.clip(share * WEIGHT_CLASSES, 0, WEIGHT_CLASSES - 1).astype(np.int64)
    new_piece = np.diff(samples.piece) != 0
    cuts = np.flatnonzero(new_piece | (np.diff(kind) != 0)) + 1
    firsts = np.concatenate(([0], cuts))
    ends = np.concatenate((cuts, [len(kind)]))
    ends[:-1] += ~new_piece[cuts - 1]  # within a piece both sides share the sample of the change
    return [samples.points[a:b] for a, b in zip(firsts, ends, strict=True)], kind[firsts]


def _add_lines(axes: Axes, lines: list[Points], colours: str | Sequence[str]) -> None:
    collection = LineCollection(lines, colors=colours, linewidths=CURVE_WIDTH_PT)
    collection.set_capstyle("round")
    collection.set_joinstyle("round")
    axes.add_collection(collection, autolim=False)


def _draw_levels(sheet: Sheet, levels: Sequence[MapLevel], colour_by: str, max_weight: int) -> None:
    palette = sheet.theme.curves
    for number, level in enumerate(levels):
        if colour_by == "weight":
            lines, kinds = _polylines_by_weight(level, max_weight)
            shades = _weight_shades(sheet.theme)
            _add_lines(sheet.axes, lines, [shades[kind] for kind in kinds])
        elif colour_by == "curve":
            colours = [palette[owner % len(palette)] for owner in drawn_pieces(level).curve]
            _add_lines(sheet.axes, _polylines(level), colours)
        else:
            _add_lines(sheet.axes, _polylines(level), palette[number % len(palette)])


def _draw_legend(sheet: Sheet, levels: Sequence[MapLevel], colour_by: str, max_weight: int) -> None:
    if colour_by == "weight":
        norm = Normalize(1, max(max_weight, 2))
        mappable = ScalarMappable(norm, ListedColormap(_weight_shades(sheet.theme)))
        draw_colour_bar(sheet, mappable, "weight", left=0.80)
    elif colour_by == "level":
        palette = sheet.theme.curves
        for number, level in enumerate(levels):
            label = f"{level.knot_step_m:g} m"
            sheet.footer.plot([], [], color=palette[number % len(palette)], lw=2.0, label=label)
        draw_names(sheet, centre=0.75)


def _weight_shades(theme: Theme) -> list[str]:
    return [to_hex(colormaps[theme.weights](x)) for x in np.linspace(*theme.shades, WEIGHT_CLASSES)]


def _draw_compared(sheet: Sheet, trajectory: Trajectory, reference: Trajectory) -> None:
    """The reference in the frame of the map, and the path coloured by its distance from it."""
    matched = match_poses(trajectory, reference, max_dt_s=MATCH_S)
    error = absolute_error(matched)
    truth = transform_poses(error.pose_reference_estimate.inverse(), reference.poses)[:, :2]
    style: dict[str, Any] = {"lw": PATH_WIDTH_PT, "ls": (0, (4, 2)), "zorder": 4}
    for axes, points in ((sheet.axes, truth.T), (sheet.footer, ([], []))):
        axes.plot(*points, color=sheet.theme.reference, label="reference", **style)
    ends = matched.estimate[:, :2]
    segments = np.stack((ends[:-1], ends[1:]), axis=1)
    norm = Normalize(0.0, max(float(error.translation_m.max()), 1e-6))
    shades = colormaps["plasma"](np.linspace(*sheet.theme.errors, 256))
    collection = LineCollection(
        list(segments), cmap=ListedColormap(shades), norm=norm, linewidths=1.2, zorder=5
    )
    collection.set_array(error.translation_m[1:])
    sheet.axes.add_collection(collection, autolim=False)
    draw_colour_bar(sheet, collection, "distance from reference [m]", left=0.55)
    if sheet.footer.get_legend() is None:
        draw_names(sheet, centre=0.42)


def _mark_size(sheet: Sheet, level: MapLevel) -> float:
    """Size of a mark [pt] that leaves room between the knots of a curve."""
    shown_from_m, shown_to_m = sheet.axes.get_xlim()
    step_pt = level.knot_step_m * 72.0 * WIDTH_INCH / (shown_to_m - shown_from_m)
    return min(max(0.4 * step_pt, MARKS_PT[0]), MARKS_PT[1])


def _knots(level: MapLevel) -> Points:
    """Points of the knots within the drawn pieces."""
    pieces = drawn_pieces(level)
    firsts = np.ceil(pieces.start - 1e-6).astype(np.int64)
    counts = np.maximum(np.floor(pieces.end + 1e-6).astype(np.int64) - firsts + 1, 0)
    number = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    u = (np.repeat(firsts, counts) + number).astype(np.float64)
    return evaluate(level, np.repeat(pieces.curve, counts), u)[0]
