"""Figure 1: frequency response of the filters, for values and slopes."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from bentray_kernels.splines import Spline
from bentray_workers.images.canvas import drawing, new_figure

from ..shared._pictures import figure_png

# A node of 1 on a long line, read so often between two nodes.
NODES, FINE = 257, 32

# Frequencies shown, in cycles a node; the highest that the nodes hold is a half.
HIGHEST = 1.5

Curve = tuple[str, Spline, str, str]

COLOURS = {2: "#7fb8a4", 3: "#1f7a8c", 4: "#3d5a98", 5: "#6a4c93", 6: "#3b1c4a"}


def picture() -> bytes:
    """PNG: four panels of frequency responses."""
    line = np.zeros(NODES)
    line[NODES // 2] = 1.0
    convolutions = [
        ("trilinear", Spline.from_volume(line, "trilinear"), "#b0b0b0", "-"),
        ("Catmull-Rom", Spline.from_volume(line, "catmull-rom"), "#d1495b", "-"),
    ]
    orders = [(f"B-spline {n}", Spline(line, n), COLOURS[n], "-") for n in range(2, 7)]
    raw = [
        (f"B-spline {n}, no prefilter", Spline(line, n, prefilter=False), COLOURS[n], "--") for n in (3, 5)
    ]
    smooth = [
        (f"B-spline 3, λ = {smoothing:g}", Spline(line, 3, smoothing=smoothing), colour, "-")
        for smoothing, colour in ((0.1, "#edae49"), (1.0, "#d1495b"), (10.0, "#7a2e1d"))
    ]
    central = ("central difference", Spline.from_volume(line, "central"), "#e08e45", "-")
    with drawing():
        figure = new_figure(9.2, 6.8)
        figure.suptitle("Frequency response of the interpolation filters")
        panels = figure.subplots(2, 2)
        draw(panels[0, 0], "Values: interpolators", convolutions + orders, slopes=False)
        draw(panels[0, 1], "Values: smoothing", [orders[1], *smooth, *raw], slopes=False)
        draw(panels[1, 0], "Slopes: interpolators", [central, *convolutions, *orders], slopes=True)
        draw(panels[1, 1], "Slopes: smoothing", [orders[1], *smooth, *raw], slopes=True)
        return figure_png(figure)


def draw(axes: Axes, title: str, curves: Sequence[Curve], *, slopes: bool) -> None:
    """One panel; the dotted line is the ideal, up to the highest frequency of the nodes."""
    for label, spline, colour, style in curves:
        frequencies, passed = response(spline, slopes=slopes)
        axes.plot(frequencies, passed, style, color=colour, linewidth=1.3, label=label)
    edge = np.pi if slopes else 1.0
    start = 0.0 if slopes else 1.0
    axes.plot([0.0, 0.5, 0.5, HIGHEST], [start, edge, 0.0, 0.0], ":", color="#222222", linewidth=1.0)
    axes.set_title(title)
    axes.set_xlim(0.0, HIGHEST)
    axes.set_xlabel("frequency (cycles a node)")
    axes.set_ylabel("gain (radians a node)" if slopes else "gain")
    axes.legend(loc="upper right")


def response(spline: Spline, *, slopes: bool) -> tuple[np.ndarray, np.ndarray]:
    """Magnitude of the Fourier transform of what a node of 1 gives."""
    points = np.arange(0.5 / FINE, NODES - 1, 1.0 / FINE)[:, np.newaxis]
    read = spline.gradient(points)[:, 0] if slopes else spline.value(points)
    frequencies = np.linspace(0.0, HIGHEST, 301)
    waves = np.exp(-2j * np.pi * np.outer(frequencies, points[:, 0] - NODES // 2))
    return frequencies, np.abs(waves @ read) / FINE
