"""Figures of Matplotlib: style, layout and PNG; one picture at a time."""

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
    # Names from files are shown unchanged: $ does not start a formula.
    "text.parse_math": False,
}
DOTS_PER_INCH = 130
# Margin around the drawing.
MARGIN_IN = 0.12

# Matplotlib is not thread-safe, and its style is global: one picture is drawn at a time.
DRAWING = Lock()


@contextmanager
def drawing() -> Iterator[None]:
    """Lock Matplotlib, with our style, for one picture."""
    with DRAWING, rc_context(STYLE):
        yield


def new_figure(width_in: float, height_in: float) -> Figure:
    """A white figure without a window, with panels in a compressed layout."""
    layout = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.06, wspace=0.0, hspace=0.0, compress=True)
    figure = Figure(figsize=(width_in, height_in), layout=layout, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def open_figure(width_in: float, height_in: float) -> Figure:
    """A white figure for axes at given positions; to be resized by ``fit`` after drawing."""
    figure = Figure(figsize=(width_in, height_in), dpi=DOTS_PER_INCH, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def fit(figure: Figure) -> None:
    """Resize a figure to its drawing and a margin; its axes keep their sizes.

    The drawing is measured once, which takes a third of the time of a layout and a second drawing.
    """
    drawn = figure.get_tightbbox(figure.canvas.get_renderer()).padded(MARGIN_IN)  # type: ignore[attr-defined]
    # From fractions of the old figure to fractions of the drawing.
    change = BboxTransformTo(figure.bbox_inches) + BboxTransformFrom(drawn)
    for axes in figure.axes:
        axes.set_position(axes.get_position().transformed(change))
    figure.set_size_inches(drawn.width, drawn.height)


def bare_figure(width: int, height: int) -> Figure:
    """A figure of given size in pixels, for axes that fill it."""
    figure = Figure(figsize=(width / DOTS_PER_INCH, height / DOTS_PER_INCH), dpi=DOTS_PER_INCH)
    FigureCanvasAgg(figure)
    return figure


def to_png(figure: Figure, longest: int | None = None, *, cropped: bool = True) -> bytes:
    """The figure as PNG; the same figure gives the same bytes.

    Args:
        figure: to save.
        longest: longest side in pixels, without cropping; text is scaled too. None: no scaling.
        cropped: crop to the drawing with a margin.
    """
    how: dict[str, Any] = {"dpi": DOTS_PER_INCH}
    if cropped:
        how |= {"bbox_inches": "tight", "pad_inches": MARGIN_IN}
    if longest is not None:
        # Matplotlib truncates fractions of a pixel.
        how["dpi"] = (longest + 0.5) / max(figure.get_size_inches())
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None}, **how)
    return buffer.getvalue()
