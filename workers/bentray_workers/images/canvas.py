"""The sheet that every picture is drawn on: style, figure, PNG bytes; one picture at a time."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.transforms import BboxTransformFrom, BboxTransformTo

STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.titlepad": 7,
    "axes.labelcolor": "#333333",
    "axes.edgecolor": "#888888",
    "axes.linewidth": 0.6,
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "figure.titlesize": 13,
    "figure.titleweight": "bold",
    "legend.frameon": False,
    "legend.fontsize": 8,
    # Names from files are shown as they are: a $ in them is no formula.
    "text.parse_math": False,
}
DOTS_PER_INCH = 130
# Around what is drawn.
MARGIN_IN = 0.12

# Matplotlib is not safe in threads, and its style is one for the process: pictures are drawn in turns.
DRAWING = Lock()


@contextmanager
def drawing() -> Iterator[None]:
    """Hold Matplotlib, in our style, for one picture."""
    with DRAWING, rc_context(STYLE):
        yield


def new_figure(width_in: float, height_in: float) -> Figure:
    """A figure on white, without a window; its panels are drawn together as far as they go."""
    layout = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.06, wspace=0.0, hspace=0.0, compress=True)
    figure = Figure(figsize=(width_in, height_in), layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def open_figure(width_in: float, height_in: float) -> Figure:
    """A figure on white, for axes that are put in their places; ``fit`` it when all is drawn."""
    figure = Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def fit(figure: Figure) -> None:
    """Make a figure just as large as what is drawn, with a margin; its axes keep their sizes.

    What is drawn is measured once, which takes a third of the time of a layout and a second drawing.
    """
    drawn = figure.get_tightbbox(figure.canvas.get_renderer()).padded(MARGIN_IN)  # type: ignore[attr-defined]
    # From parts of the figure as it was to parts of what is drawn.
    change = BboxTransformTo(figure.bbox_inches) + BboxTransformFrom(drawn)
    for axes in figure.axes:
        axes.set_position(axes.get_position().transformed(change))
    figure.set_size_inches(drawn.width, drawn.height)


def bare_figure(width: int, height: int) -> Figure:
    """A figure of so many pixels, for axes that fill it."""
    figure = Figure(figsize=(width / DOTS_PER_INCH, height / DOTS_PER_INCH), dpi=DOTS_PER_INCH)
    FigureCanvasAgg(figure)
    return figure


def to_png(figure: Figure, longest: int | None = None, *, cropped: bool = True) -> bytes:
    """The figure as PNG; the same figure gives the same bytes.

    Args:
        figure: what is drawn.
        longest: its longest side in pixels, of one that is not cropped; text grows and shrinks with it.
            None: text keeps its size.
        cropped: to what is drawn, with a margin.
    """
    how: dict[str, Any] = {"dpi": DOTS_PER_INCH}
    if cropped:
        how |= {"bbox_inches": "tight", "pad_inches": MARGIN_IN}
    if longest is not None:
        # Matplotlib cuts fractions of a pixel off.
        how["dpi"] = (longest + 0.5) / max(figure.get_size_inches())
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None}, **how)
    return buffer.getvalue()
