"""The parts that pictures are made of: maps with a colour bar, profiles, residual histories; PNG bytes."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from threading import Lock

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from bentray_kernels.tomography import Sweep

Floats = NDArray[np.float64]
Limits = tuple[float, float]

STYLE = {
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "axes.titlesize": 10,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
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
    "text.parse_math": False,
}
LINES = ("#d1495b", "#00798c", "#edae49", "#30638e", "#66a182")
MISSING = "#e4e4e4"
DOTS_PER_INCH = 130

# Parts of the nodes that robust limits leave outside, at each end, per cent.
OUTSIDE_PERCENT = 0.1

# Matplotlib is not safe in threads, and its style is one for the process: pictures are drawn in turns.
DRAWING = Lock()


@contextmanager
def drawing() -> Iterator[None]:
    """Hold Matplotlib, in our style, for one picture."""
    with DRAWING, rc_context(STYLE):
        yield


def new_figure(width_in: float, height_in: float) -> Figure:
    """A figure on white, without a window."""
    margins = ConstrainedLayoutEngine(w_pad=0.1, h_pad=0.12)
    figure = Figure(figsize=(width_in, height_in), layout=margins, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def to_png(figure: Figure) -> bytes:
    """The figure as PNG; the same figure gives the same bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    return buffer.getvalue()


def robust_limits(images: Iterable[Floats], region: NDArray[np.bool_] | None = None) -> Limits:
    """Lowest and highest value but for a few outliers; never one and the same."""
    values = np.concatenate(
        [image[np.isfinite(image) if region is None else region & np.isfinite(image)] for image in images]
    )
    if not values.size:
        return 0.0, 1.0
    low, high = np.percentile(values, [OUTSIDE_PERCENT, 100.0 - OUTSIDE_PERCENT])
    least = 1e-6 * max(abs(low), abs(high)) or 1.0
    return (float(low), float(high)) if high - low > least else (float(low - least), float(low + least))


def draw_map(
    axes: Axes,
    image: Floats,
    spacing_m: tuple[float, ...],
    origin_m: tuple[float, ...],
    limits: Limits,
    *,
    colormap: str,
    title: str,
    label: str | None,
) -> None:
    """An image (nx, ny) with x to the right and y up, in mm; ``label`` names its colour bar, None: none."""
    corners = []
    for axis in (0, 1):
        first = origin_m[axis] - 0.5 * spacing_m[axis]
        corners += [1e3 * first, 1e3 * (first + image.shape[axis] * spacing_m[axis])]
    shown = axes.imshow(
        np.ma.masked_invalid(image.T),
        origin="lower",
        extent=(corners[0], corners[1], corners[2], corners[3]),
        vmin=limits[0],
        vmax=limits[1],
        cmap=colormaps[colormap].with_extremes(bad=MISSING),
        interpolation="nearest",
        aspect="equal",
    )
    axes.set_title(title)
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("y (mm)")
    axes.xaxis.set_major_locator(MaxNLocator(5))
    axes.yaxis.set_major_locator(MaxNLocator(5))
    if label is not None:
        finite = image[np.isfinite(image)]
        below, above = bool((finite < limits[0]).any()), bool((finite > limits[1]).any())
        extend = {(False, False): "neither", (True, False): "min", (False, True): "max"}.get(
            (below, above), "both"
        )
        bar = axes.figure.colorbar(shown, ax=axes, fraction=0.046, pad=0.03, extend=extend)
        bar.set_label(label)
        bar.outline.set_linewidth(0.4)


def draw_history(axes: Axes, histories: Mapping[str, tuple[Sweep, ...]]) -> None:
    """Residual against sweep, a line a name; over slices the root mean square."""
    highest = 0.0
    lowest = np.inf
    for (name, history), colour in zip(
        histories.items(), LINES * (1 + len(histories) // len(LINES)), strict=False
    ):
        sweeps = sorted({s.sweep for s in history})
        rms = [
            1e9 * np.sqrt(np.mean([s.residual_rms_s**2 for s in history if s.sweep == sweep]))
            for sweep in sweeps
        ]
        axes.plot(sweeps, rms, "o-", color=colour, linewidth=1.6, markersize=4, label=name)
        highest = max([highest, *rms])
        lowest = min([lowest, *rms])
    axes.set_title("Convergence")
    axes.set_xlabel("sweep")
    axes.set_ylabel("residual rms (ns)")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if highest > 0.0 and lowest > 0.0 and highest > 20.0 * lowest:
        axes.set_yscale("log")
    else:
        axes.set_ylim(0.0, 1.08 * highest or 1.0)
    axes.grid(color="#dddddd", linewidth=0.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_box_aspect(1.0)
    if len(histories) > 1:
        axes.legend()


def draw_profiles(axes: Axes, place_m: Floats, profiles: Mapping[str, Floats], title: str) -> None:
    """Speeds along a line, m/s against mm; the first is the truth."""
    for k, (name, values) in enumerate(profiles.items()):
        colour, width = ("#222222", 1.0) if k == 0 else (LINES[(k - 1) % len(LINES)], 1.6)
        axes.plot(1e3 * place_m, values, color=colour, linewidth=width, label=name)
    axes.set_title(title)
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("sound speed (m/s)")
    axes.margins(x=0.0)
    axes.grid(color="#dddddd", linewidth=0.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_box_aspect(1.0)
    axes.legend()
