"""A slice drawn: in a frame with a colour bar and its unit, or as the bare image, both of any size."""

from __future__ import annotations

import math

from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from .canvas import bare_figure, drawing, new_figure, to_png
from .look import INTERPOLATIONS, MOST_SIZE, Look
from .maps import Limits, draw_bar, draw_map
from .plane import Plane

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
        if not look.frame:
            return _bare(plane, limits, look)
        figure = new_figure(6.6, 5.9)
        axes = figure.subplots()
        shown = draw_map(
            axes,
            plane.image,
            plane.spacing_m,
            plane.origin_m,
            limits,
            colormap=look.colormap,
            title=title,
            up=plane.names[1],
        )
        axes.set_xlabel(f"{plane.names[0]} (mm)")
        shown.set_interpolation(INTERPOLATIONS[look.interpolation])
        if look.scale_bar:
            _draw_scale_bar(axes, plane)
        if look.colour_bar:
            draw_bar([shown], unit)
        figure.supxlabel(note, fontsize=8, color="#666666")
        return to_png(figure, look.size)


def _bare(plane: Plane, limits: Limits, look: Look) -> bytes:
    sides = [n * h for n, h in zip(plane.image.shape, plane.spacing_m, strict=True)]
    longest = look.size or min(max(plane.image.shape), MOST_SIZE)
    width, height = (max(1, round(longest * side / max(sides))) for side in sides)
    figure = bare_figure(width, height)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    shown = draw_map(
        axes, plane.image, plane.spacing_m, plane.origin_m, limits, colormap=look.colormap, title=""
    )
    shown.set_interpolation(INTERPOLATIONS[look.interpolation])
    axes.set_aspect("auto")
    axes.set_axis_off()
    if look.scale_bar:
        _draw_scale_bar(axes, plane)
    return to_png(figure, cropped=False)


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
