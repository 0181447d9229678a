"""What all pictures share: themes, the canvas with its footer, the scale bar, and saving."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from bsmap_cli.exchange.rounding import round_length

Bounds = tuple[float, float, float, float]  # x0, y0, x1, y1 [m]

WIDTH_INCH, FOOTER_INCH, DPI = 10.0, 0.55, 200
FLATTEST, TALLEST = 0.25, 2.0  # height over width of the map's part of a picture
# what would tie a picture's bytes to the clock or to the release of matplotlib
NO_METADATA: dict[str, dict[str, Any]] = {
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
}


@dataclass(frozen=True, slots=True)
class Theme:
    """Colours of a picture.

    weights names a colour map, of which the part `shades` is used; of the colour map for errors
    the part `errors` stands out from the ground.
    """

    ground: str
    ink: str
    path: str
    reference: str
    overlay: str
    weights: str
    shades: tuple[float, float]
    errors: tuple[float, float]
    curves: tuple[str, ...]


LIGHT = Theme(
    ground="#ffffff",
    ink="#1b2733",
    path="#d1495b",
    reference="#3a86c8",
    overlay="#e07a1f",
    weights="YlGnBu",
    shades=(0.4, 1.0),
    errors=(0.0, 0.85),
    curves=("#1f77b4", "#d95f02", "#1b9e77", "#7b3fa0", "#c2185b", "#8d6e2f", "#00838f", "#4b5563"),
)
DARK = Theme(
    ground="#10161d",
    ink="#dfe7ee",
    path="#ff6b7d",
    reference="#6bb7ff",
    overlay="#ffab5e",
    weights="YlGnBu_r",
    shades=(0.3, 1.0),
    errors=(0.3, 1.0),
    curves=("#6bb7ff", "#ffab5e", "#63d2a3", "#c9a0ff", "#ff8fb3", "#e3c878", "#5fd6e0", "#b7c2cd"),
)


def theme_of(dark: bool) -> Theme:
    """The dark or the light theme."""
    return DARK if dark else LIGHT


@dataclass(frozen=True, slots=True)
class Sheet:
    """A figure with axes to scale for the map and a footer whose axes run from 0 to 1."""

    figure: Figure
    axes: Axes
    footer: Axes
    theme: Theme


def map_sheet(bounds: Bounds, theme: Theme) -> Sheet:
    """A sheet that shows the bounds."""
    x0, y0, x1, y1 = bounds
    map_inch = WIDTH_INCH * min(max((y1 - y0) / (x1 - x0), FLATTEST), TALLEST)
    height = map_inch + FOOTER_INCH
    figure = Figure(figsize=(WIDTH_INCH, height), dpi=DPI, facecolor=theme.ground)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, FOOTER_INCH / height, 1.0, map_inch / height))
    axes.set_aspect("equal")
    axes.set_xlim(x0, x1)
    axes.set_ylim(y0, y1)
    axes.set_axis_off()
    footer = figure.add_axes((0.0, 0.0, 1.0, FOOTER_INCH / height))
    footer.set_xlim(0.0, 1.0)
    footer.set_ylim(0.0, 1.0)
    footer.set_axis_off()
    return Sheet(figure, axes, footer, theme)


def draw_scale_bar(sheet: Sheet) -> None:
    """A bar of a round length with end marks, at the left of the footer."""
    shown_from_m, shown_to_m = sheet.axes.get_xlim()
    shown_width_m = shown_to_m - shown_from_m
    length_m = round_length(0.2 * shown_width_m)
    left, right = 0.03, 0.03 + length_m / shown_width_m
    xs, ys = [left, left, left, right, right, right], [0.55, 0.35, 0.45, 0.45, 0.35, 0.55]
    sheet.footer.plot(xs, ys, color=sheet.theme.ink, lw=1.2, solid_joinstyle="miter")
    text = f"{length_m:g} m" if length_m >= 1.0 else f"{100 * length_m:g} cm"
    middle = 0.5 * (left + right)
    style: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": 8}
    sheet.footer.text(middle, 0.6, text, color=sheet.theme.ink, **style)


def draw_colour_bar(sheet: Sheet, mappable: ScalarMappable, label: str, *, left: float) -> None:
    """A slim scale of colours in the footer, from `left` of its width."""
    place = sheet.footer.inset_axes((left, 0.5, 0.17, 0.14))
    bar = sheet.figure.colorbar(mappable, cax=place, orientation="horizontal")
    bar.ax.tick_params(colors=sheet.theme.ink, labelsize=7, length=2)
    bar.ax.set_title(label, color=sheet.theme.ink, fontsize=8, pad=3)
    for spine in bar.ax.spines.values():
        spine.set_visible(False)


def draw_names(sheet: Sheet, *, centre: float) -> None:
    """The lines of the footer that have a label, beside each other, `centre` of its width."""
    handles, labels = sheet.footer.get_legend_handles_labels()
    sheet.footer.legend(
        handles,
        labels,
        loc="center",
        bbox_to_anchor=(centre, 0.5),
        ncols=len(labels),
        frameon=False,
        fontsize=8,
        labelcolor=sheet.theme.ink,
    )


def save_figure(
    figure: Figure, stream: BinaryIO, format_: str, *, width_px: int | None = None
) -> None:
    """Write `png`, `svg` or `pdf`; the same figure gives the same bytes.

    width_px : of a PNG, 2000 by default.
    """
    if format_ == "png":
        _write_png(figure, stream, width_px)
        return
    with rc_context({"svg.hashsalt": "bsmap"}):
        figure.savefig(
            stream, format=format_, facecolor=figure.get_facecolor(), metadata=NO_METADATA[format_]
        )


def _write_png(figure: Figure, stream: BinaryIO, width_px: int | None) -> None:
    """A picture of few colours, a third of the bytes of one of all."""
    from PIL import Image

    if width_px is not None:
        figure.set_dpi(width_px / figure.get_figwidth())
    canvas: Any = FigureCanvasAgg(figure)  # its methods are not typed
    canvas.draw()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    few = image.quantize(256, method=Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    few.save(stream, "png", optimize=True)
