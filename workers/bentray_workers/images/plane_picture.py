"""Picture of a slice: with frame and colour bar, or the image alone, of any size."""

import math
from typing import Any

from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from .canvas import bare_figure, drawing, fit, open_figure, to_png
from .maps import Limits, draw_bar, draw_map
from .plane import Plane
from .slice_style import INTERPOLATIONS, MAX_SIZE, SliceStyle

# Framed picture, inches: longest side of the image, and the colour bar.
LONGEST_IN = 4.96
BAR_IN, BAR_GAP_IN, MIN_BAR_IN = 0.19, 0.075, 1.6
# Smallest space of a number along an axis.
NUMBER_IN = 0.5
# From the lower edge of the image, below the name of its axis.
NOTE_POINTS = -36
# Largest length of a scale bar, and its distance from the corner, relative to the width of the image.
MAX_WIDTH_FRACTION, MARGIN = 0.3, 0.05


def plane_png(plane: Plane, limits: Limits, style: SliceStyle, *, title: str, unit: str, note: str) -> bytes:
    """A slice as PNG.

    Args:
        plane: the slice.
        limits: values of the first and the last colour.
        style: of the picture.
        title: above it.
        unit: the quantity with its unit, beside the colour bar.
        note: below it.
    """
    with drawing():
        return (
            _framed(plane, limits, style, title, unit, note) if style.frame else _bare(plane, limits, style)
        )


def _framed(plane: Plane, limits: Limits, style: SliceStyle, title: str, unit: str, note: str) -> bytes:
    width, height = (LONGEST_IN * side for side in _shares(plane))
    sheet = (width + 2.0, height + 2.0)
    figure = open_figure(*sheet)

    def add_axes(left: float, bottom: float, wide: float, high: float) -> Axes:
        return figure.add_axes((left / sheet[0], bottom / sheet[1], wide / sheet[0], high / sheet[1]))

    axes = add_axes(1.0, 1.0, width, height)
    shown = _draw_image(axes, plane, limits, style, title)
    axes.set_xlabel(f"{plane.names[0]} (mm)")
    for axis, side in ((axes.xaxis, width), (axes.yaxis, height)):
        axis.set_major_locator(MaxNLocator(min(5, int(side / NUMBER_IN) + 1)))
    if style.colour_bar:
        # Beside a flat image the bar is higher, to fit its numbers.
        bar_axes = add_axes(1.0 + width + BAR_GAP_IN, 1.0, BAR_IN, max(height, MIN_BAR_IN))
        draw_bar([shown], unit, bar_axes)
    small: dict[str, Any] = {"fontsize": 8, "color": "#666666", "ha": "center", "va": "top"}
    axes.annotate(note, (0.5, 0.0), (0.0, NOTE_POINTS), "axes fraction", "offset points", **small)
    fit(figure)
    return to_png(figure, style.size, cropped=False)


def _bare(plane: Plane, limits: Limits, style: SliceStyle) -> bytes:
    longest = style.size or min(max(plane.image.shape), MAX_SIZE)
    figure = bare_figure(*(max(1, round(longest * side)) for side in _shares(plane)))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    _draw_image(axes, plane, limits, style, "")
    axes.set_axis_off()
    return to_png(figure, cropped=False)


def _shares(plane: Plane) -> tuple[float, ...]:
    """Width and height relative to the larger of them."""
    sides = [n * h for n, h in zip(plane.image.shape, plane.spacing_m, strict=True)]
    return tuple(side / max(sides) for side in sides)


def _draw_image(axes: Axes, plane: Plane, limits: Limits, style: SliceStyle, title: str) -> AxesImage:
    """The image on axes with its aspect ratio."""
    grid = plane.spacing_m, plane.origin_m
    shown = draw_map(
        axes, plane.image, *grid, limits, colormap=style.colormap, title=title, up=plane.names[1]
    )
    shown.set_interpolation(INTERPOLATIONS[style.interpolation])
    axes.set_aspect("auto")
    if style.scale_bar:
        _draw_scale_bar(axes, plane)
    return shown


def scale_of(width_m: float) -> float:
    """A round length of at most ``MAX_WIDTH_FRACTION``, m: 1, 2 or 5 of some power of ten."""
    most = MAX_WIDTH_FRACTION * width_m
    power = 10.0 ** math.floor(math.log10(most))
    return max(step * power for step in (0.5, 1.0, 2.0, 5.0) if step * power <= most)


def _draw_scale_bar(axes: Axes, plane: Plane) -> None:
    """White with a dark edge, visible on any colour."""
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
