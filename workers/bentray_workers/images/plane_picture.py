"""A slice drawn: in a frame with a colour bar and its unit, or as the bare image, both of any size."""

from __future__ import annotations

import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from .canvas import bare_figure, drawing, fit, open_figure, to_png
from .look import INTERPOLATIONS, MOST_SIZE, Look
from .maps import Limits, draw_bar, draw_map
from .plane import Plane

# Of a framed picture, inches: the image's longest side, and the colour bar.
LONGEST_IN = 4.96
BAR_IN, BAR_GAP_IN, LEAST_BAR_IN = 0.19, 0.075, 1.6
# What a number along an axis needs at least.
NUMBER_IN = 0.5
# From the lower edge of the image, below the name of its axis.
NOTE_POINTS = -36
# Of the width of the image: the most that a scale bar takes, and its distance from the corner.
MOST_OF_WIDTH, MARGIN = 0.3, 0.05


def plane_png(plane: Plane, limits: Limits, look: Look, *, title: str, unit: str, note: str) -> bytes:
    """A slice as PNG.

    Args:
        plane: what is drawn.
        limits: values of the first and the last colour.
        look: how it looks.
        title: above it.
        unit: the quantity with its unit, beside the colour bar.
        note: below it, in small print.
    """
    with drawing():
        return _framed(plane, limits, look, title, unit, note) if look.frame else _bare(plane, limits, look)


def _framed(plane: Plane, limits: Limits, look: Look, title: str, unit: str, note: str) -> bytes:
    width, height = (LONGEST_IN * side for side in _shares(plane))
    sheet = (width + 2.0, height + 2.0)
    figure = open_figure(*sheet)

    def place(left: float, bottom: float, wide: float, high: float) -> Axes:
        return figure.add_axes((left / sheet[0], bottom / sheet[1], wide / sheet[0], high / sheet[1]))

    axes = place(1.0, 1.0, width, height)
    shown = _draw_image(axes, plane, limits, look, title)
    axes.set_xlabel(f"{plane.names[0]} (mm)")
    for axis, side in ((axes.xaxis, width), (axes.yaxis, height)):
        axis.set_major_locator(MaxNLocator(min(5, int(side / NUMBER_IN) + 1)))
    if look.colour_bar:
        # Beside a flat image a bar is higher than it, to have room for its numbers.
        beside = place(1.0 + width + BAR_GAP_IN, 1.0, BAR_IN, max(height, LEAST_BAR_IN))
        draw_bar([shown], unit, beside)
    small: dict[str, Any] = {"fontsize": 8, "color": "#666666", "ha": "center", "va": "top"}
    axes.annotate(note, (0.5, 0.0), (0.0, NOTE_POINTS), "axes fraction", "offset points", **small)
    fit(figure)
    return to_png(figure, look.size, cropped=False)


def _bare(plane: Plane, limits: Limits, look: Look) -> bytes:
    longest = look.size or min(max(plane.image.shape), MOST_SIZE)
    figure = bare_figure(*(max(1, round(longest * side)) for side in _shares(plane)))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    _draw_image(axes, plane, limits, look, "")
    axes.set_axis_off()
    return to_png(figure, cropped=False)


def _shares(plane: Plane) -> tuple[float, ...]:
    """Width and height over the larger of them."""
    sides = [n * h for n, h in zip(plane.image.shape, plane.spacing_m, strict=True)]
    return tuple(side / max(sides) for side in sides)


def _draw_image(axes: Axes, plane: Plane, limits: Limits, look: Look, title: str) -> AxesImage:
    """The image on axes that have its proportions."""
    grid = plane.spacing_m, plane.origin_m
    shown = draw_map(axes, plane.image, *grid, limits, colormap=look.colormap, title=title, up=plane.names[1])
    shown.set_interpolation(INTERPOLATIONS[look.interpolation])
    axes.set_aspect("auto")
    if look.scale_bar:
        _draw_scale_bar(axes, plane)
    return shown


def scale_of(width_m: float) -> float:
    """A round length of at most ``MOST_OF_WIDTH``, m: 1, 2 or 5 of some power of ten."""
    most = MOST_OF_WIDTH * width_m
    power = 10.0 ** math.floor(math.log10(most))
    return max(step * power for step in (0.5, 1.0, 2.0, 5.0) if step * power <= most)


def _draw_scale_bar(axes: Axes, plane: Plane) -> None:
    """White with a dark rim, to be seen on any colour."""
    length = 1e3 * scale_of(plane.image.shape[0] * plane.spacing_m[0])
    left, right = axes.get_xlim()
    low, high = axes.get_ylim()
    begin, base = left + MARGIN * (right - left), low + MARGIN * (high - low)
    rim = [withStroke(linewidth=2.5, foreground="#222222")]
    axes.plot(
        [begin, begin + length],
        [base, base],
        color="white",
        linewidth=2.5,
        solid_capstyle="butt",
        path_effects=[withStroke(linewidth=4.5, foreground="#222222")],
    )
    axes.annotate(
        f"{length:g} mm",
        (begin + 0.5 * length, base),
        xytext=(0, 4),
        textcoords="offset points",
        ha="center",
        va="bottom",
        color="white",
        fontsize=9,
        path_effects=rim,
    )
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
