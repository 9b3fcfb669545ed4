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


def bare_figure(width: int, height: int) -> Figure:
    """A figure of so many pixels, for axes that fill it."""
    figure = Figure(figsize=(width / DOTS_PER_INCH, height / DOTS_PER_INCH), dpi=DOTS_PER_INCH)
    FigureCanvasAgg(figure)
    return figure


def to_png(figure: Figure, longest: int | None = None, *, cropped: bool = True) -> bytes:
    """The figure as PNG; the same figure gives the same bytes.

    Args:
        figure: what is drawn.
        longest: its longest side in pixels; text grows and shrinks with it. None: text keeps its size.
        cropped: to what is drawn, with a margin.
    """
    how: dict[str, Any] = {"dpi": DOTS_PER_INCH}
    if cropped:
        how |= {"bbox_inches": "tight", "pad_inches": MARGIN_IN}
    if longest is not None:
        how |= _fitted(figure, longest)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None}, **how)
    return buffer.getvalue()


def _fitted(figure: Figure, longest: int) -> dict[str, Any]:
    """Resolution and part of the figure that make its longest side so many pixels."""
    # Text is set by whole pixels, so what is drawn is measured at about the resolution that it will have.
    figure.dpi = longest / max(figure.get_size_inches())
    figure.draw_without_rendering()
    drawn = figure.get_tightbbox(figure.canvas.get_renderer()).padded(MARGIN_IN)  # type: ignore[attr-defined]
    # Matplotlib cuts fractions of a pixel off.
    return {"bbox_inches": drawn, "dpi": (longest + 0.5) / max(drawn.width, drawn.height)}
