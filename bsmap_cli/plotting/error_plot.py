"""Errors over time."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from bsmap_cli.evaluation.trajectory_error import AbsoluteError
from bsmap_cli.plotting.figures import DPI, WIDTH_INCH, Theme, theme_of


def plot_error(error: AbsoluteError, *, dark: bool = False) -> Figure:
    """Distance and angle to the reference over time, one below the other."""
    theme = theme_of(dark)
    figure = Figure(figsize=(WIDTH_INCH, 5.0), dpi=DPI, facecolor=theme.ground)
    FigureCanvasAgg(figure)
    seconds = (error.stamps_ns - error.stamps_ns.min()) * 1e-9
    upper, lower = figure.subplots(2, 1, sharex=True)
    for axes, values, label in (
        (upper, error.translation_m, "translation [m]"),
        (lower, error.rotation_deg, "rotation [deg]"),
    ):
        axes.plot(seconds, values, color=theme.path, lw=0.8)
        axes.set_ylabel(label)
        axes.set_ylim(bottom=0.0)
        _dress(axes, theme)
    lower.set_xlabel("time [s]")
    figure.tight_layout()
    return figure


def _dress(axes: Axes, theme: Theme) -> None:
    axes.set_facecolor(theme.ground)
    axes.tick_params(colors=theme.ink, labelsize=8)
    axes.yaxis.label.set_color(theme.ink)
    axes.xaxis.label.set_color(theme.ink)
    axes.grid(True, color=theme.ink, alpha=0.15, lw=0.5)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_color(theme.ink)
