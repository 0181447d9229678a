"""Pictures after the paper's Figs. 3 to 6."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from paper_missions import NOISES_M, PROFILES, MissionRun
from paper_studies import ShapesRun
from PIL import Image

from bsmap_cli.geometry.se2 import SE2, Points
from bsmap_cli.mapping.map_document import MapLevel
from bsmap_cli.mapping.sampling import sample_level
from bsmap_cli.plotting import save_figure
from bsmap_cli.plotting.figures import LIGHT
from bsmap_cli.sensor.simulator.simulation import Simulation, simulate

DPI, COLOURS = 90, 64
POINTS = 250  # of a line: more only make the file larger
TRUTH = {"colors": "#9aa5b1", "linewidths": 2.4}
LINES = {"0.4": ("#d97706", "-"), "0.2": ("#2563eb", "-"), "0.1": ("#0f9f6e", "-")} | {
    "ladder": ("#7c2d92", "--")
}
NAMES = {"0.4": "Δ 0.4 m", "0.2": "Δ 0.2 m", "0.1": "Δ 0.1 m", "ladder": "0.4, 0.2, 0.1 m"}


def draw_shapes(run: ShapesRun, folder: Path) -> None:
    """Fig. 3: the room on the left, its map on the right."""
    simulation = simulate("shapes", odometry=False)
    figure = _figure(10.0, 4.4)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    _draw_truth(left, simulation, colors="#1b2733", linewidths=1.2)
    left.plot(*simulation.truth.poses[:, :2].T, color=LIGHT.path, lw=0.8)
    left.set_title("the room and the way through it", fontsize=9)
    start = SE2.from_array(simulation.truth.poses[0])
    _draw_curves(right, run.document.finest, start)
    statistics = run.statistics
    right.set_title(
        f"{run.profile}, {100 * run.noise_m:g} cm noise: {statistics.curves} curves, "
        f"{statistics.control_points} control points, {statistics.payload_bytes} bytes",
        fontsize=9,
    )
    _save(figure, folder / "fig3-shapes.png")


def draw_missions(runs: list[MissionRun], folder: Path) -> None:
    """Fig. 4: map and way of the ladder, over the true surfaces and the true way."""
    shown = [r for r in runs if r.ladder == "ladder"]
    for mission in sorted({r.mission for r in shown}):
        figure = _figure(10.0, 4.2 if mission == "wall" else 9.0)
        panels = figure.subplots(len(PROFILES), len(NOISES_M), squeeze=False)
        for run in (r for r in shown if r.mission == mission):
            axes = panels[PROFILES.index(run.profile), NOISES_M.index(run.noise_m)]
            simulation = simulate(mission, odometry=False)
            start = SE2.from_array(simulation.truth.poses[0])
            _draw_truth(axes, simulation, **TRUTH)
            box = axes.axis()
            _draw_curves(axes, run.document.finest, start)
            axes.plot(*start.transform(run.truth[:, :2]).T, color=LIGHT.reference, lw=1.0)
            axes.plot(*start.transform(run.estimate[:, :2]).T, color=LIGHT.path, lw=0.8)
            axes.axis(box)
            axes.set_title(_panel_name(run), fontsize=9)
        _save(figure, folder / f"fig4-{mission}.png")


def draw_errors(runs: list[MissionRun], folder: Path) -> None:
    """Figs. 5 and 6: errors over time, one line a knot step; the axis is logarithmic."""
    for number, mission in ((5, "wall"), (6, "spin")):
        figure = _figure(10.0, 8.0)
        panels = figure.subplots(4, 2, sharex=True, sharey="row", squeeze=False)
        for run in (r for r in runs if r.mission == mission):
            column, row = NOISES_M.index(run.noise_m), 2 * PROFILES.index(run.profile)
            colour, dashes = LINES[run.ladder]
            upper, lower = panels[row, column], panels[row + 1, column]
            style = {"color": colour, "ls": dashes, "lw": 0.9, "label": NAMES[run.ladder]}
            shown = slice(1, None, max(1, len(run.seconds) // POINTS))
            upper.plot(run.seconds[shown], 1e3 * run.metres[shown], **style)
            lower.plot(run.seconds[shown], run.degrees[shown], **style)
            upper.set_title(_panel_name(run), fontsize=9)
            upper.set_ylabel("translation [mm]", fontsize=8)
            lower.set_ylabel("rotation [deg]", fontsize=8)
        for axes in panels.flat:
            axes.set_yscale("log")
            axes.grid(alpha=0.2, lw=0.5)
            axes.tick_params(labelsize=7)
        for axes in panels[::2].flat:
            axes.set_ylim(bottom=1e-2)
        for axes in panels[1::2].flat:
            axes.set_ylim(bottom=1e-4)
        for axes in panels[-1]:
            axes.set_xlabel("time [s]", fontsize=8)
        if panels[0, 0].lines:
            panels[0, 0].legend(fontsize=7, ncols=2)
            _save(figure, folder / f"fig{number}-{mission}.png")


def _panel_name(run: MissionRun) -> str:
    return f"{run.profile}, {100 * run.noise_m:g} cm noise"


def _figure(width_inch: float, height_inch: float) -> Figure:
    figure = Figure(figsize=(width_inch, height_inch), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def _draw_truth(axes: Axes, simulation: Simulation, **style: object) -> None:
    axes.add_collection(LineCollection([s.points for s in simulation.world.surfaces()], **style))
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.set_axis_off()


def _draw_curves(axes: Axes, level: MapLevel, pose_world_map: SE2) -> None:
    samples = sample_level(level, level.knot_step_m / 8)
    points = pose_world_map.transform(samples.points)
    lines: list[Points] = []
    colours = []
    for piece in range(int(samples.piece.max(initial=-1)) + 1):
        begin, end = samples.piece.searchsorted((piece, piece + 1))
        lines.append(points[begin:end])
        colours.append(LIGHT.curves[int(samples.curve[begin]) % len(LIGHT.curves)])
    axes.add_collection(LineCollection(lines, colors=colours, linewidths=1.0), autolim=False)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _save(figure: Figure, path: Path) -> None:
    """As a picture of few colours: a quarter of the bytes."""
    stream = BytesIO()
    save_figure(figure, stream, "png")
    with Image.open(stream) as picture:
        picture.convert("RGB").quantize(COLOURS).save(path, optimize=True)
