"""Curves: residual by iteration, speeds along a line."""

from collections.abc import Mapping, Sequence
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from bentray_kernels.tomography import Iteration

Floats = NDArray[np.float64]

LINES = ("#d1495b", "#00798c", "#edae49", "#30638e", "#66a182")

# Ratio of the highest to the lowest residual above which the axis is logarithmic.
WIDE = 20.0


def draw_history(
    axes: Axes, histories: Mapping[str, tuple[Iteration, ...]], stages: Sequence[str] = ()
) -> None:
    """Residual against iteration, a line a name; over slices the root mean square.

    Stages follow each other from left to right, with a dotted line where a next one begins.

    Args:
        histories: by the name to show.
        stages: names of the stages, where all histories have the same.
    """
    every: list[float] = []
    for (name, history), colour in zip(histories.items(), cycle(LINES), strict=False):
        begun = 0
        for number, rms in enumerate(_segments(history)):
            iterations = begun + np.arange(1, len(rms) + 1)
            # Matplotlib omits labels with an underscore from the legend.
            label = name if number == 0 else f"_{name}"
            axes.plot(iterations, rms, "o-", color=colour, linewidth=1.6, markersize=4, label=label)
            if number:
                axes.axvline(begun + 0.5, color="#888888", linewidth=0.9, linestyle=":")
            if number < len(stages):
                _name_stage(axes, begun + 0.5 * (len(rms) + 1), stages[number])
            begun += len(rms)
            every += rms
    slices = {s.slice for history in histories.values() for s in history}
    axes.set_title("Convergence" if len(slices) < 2 else f"Convergence, all {len(slices)} slices")
    axes.set_xlabel("iteration")
    axes.set_ylabel("residual rms (ns)", labelpad=1)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    _scale(axes, every, margin=bool(stages))
    _style_axes(axes)
    if len(histories) > 1:
        legend_below(axes)


def legend_below(axes: Axes, markerscale: float = 1.0) -> None:
    """A legend below the label of the x axis, outside the data."""
    options = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.13), "ncol": 2}
    axes.legend(**options, handletextpad=0.4, markerscale=markerscale)


def _segments(history: tuple[Iteration, ...]) -> list[list[float]]:
    """Residual of every iteration of each stage, ns; over slices the root mean square."""
    squares: dict[int, dict[int, list[float]]] = {}
    for s in history:
        squares.setdefault(s.stage, {}).setdefault(s.sweep, []).append(s.residual_rms_s**2)
    return [
        [1e9 * float(np.sqrt(np.mean(values))) for _, values in sorted(of_stage.items())]
        for _, of_stage in sorted(squares.items())
    ]


def _name_stage(axes: Axes, x: float, name: str) -> None:
    axes.text(
        x,
        0.985,
        name,
        transform=axes.get_xaxis_transform(),
        horizontalalignment="center",
        verticalalignment="top",
        fontsize=7,
        color="#555555",
    )


def _scale(axes: Axes, every: list[float], *, margin: bool) -> None:
    """From zero, or logarithmic for a wide range; with a margin for names of stages."""
    if every and min(every) > 0.0 and max(every) > WIDE * min(every):
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, position: f"{value:g}"))
        if margin:
            axes.set_ylim(top=max(every) * (max(every) / min(every)) ** 0.2)
    else:
        axes.set_ylim(0.0, (1.25 if margin else 1.08) * max(every, default=0.0) or 1.0)


def draw_profiles(axes: Axes, place_m: Floats, profiles: Mapping[str, Floats], title: str) -> None:
    """Speeds along a line, m/s against mm; the first is the truth."""
    for k, (name, values) in enumerate(profiles.items()):
        colour, width = ("#222222", 1.0) if k == 0 else (LINES[(k - 1) % len(LINES)], 1.6)
        axes.plot(1e3 * place_m, values, color=colour, linewidth=width, label=name)
    axes.set_title(title)
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("sound speed (m/s)", labelpad=1)
    axes.margins(x=0.0)
    _style_axes(axes)
    legend_below(axes)


def _style_axes(axes: Axes) -> None:
    axes.grid(color="#dddddd", linewidth=0.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_box_aspect(1.0)
