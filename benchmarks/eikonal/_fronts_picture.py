"""Figure of wave fronts and of errors in log colour, one column per method."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.image import AxesImage
from matplotlib.ticker import FuncFormatter

from bentray_kernels import eikonal
from bentray_workers.images.canvas import drawing, new_figure
from bentray_workers.images.maps import SPEED, draw_bar, draw_map

from ..shared._pictures import figure_png
from .eikonal import Problem

# Twelve colours over four decades: smooth ones would make the file too large for the repository.
ERROR = "magma in steps"
colormaps.register(colormaps["magma"].resampled(12), name=ERROR, force=True)
PANEL_IN = (1.85, 2.25)

# Distinct from every colour of the errors.
RING = "#2ec4ff"

# Decades of error shown below the largest.
DECADES = 4


@dataclass(frozen=True)
class Solved:
    """Times at the nodes, s; absolute errors at the nodes, s; errors at the ring, s."""

    time: np.ndarray
    error: np.ndarray
    ring: np.ndarray


@dataclass(frozen=True)
class Case:
    """A problem as every method solves it, and how to show it.

    Attributes:
        title: what the rows of the picture are called.
        problem: the grid, with its ring of receivers.
        solved: by the name of the method.
        unit, per_second: of the errors.
        step, step_text: time between two wave fronts, s, and as it is written.
    """

    title: str
    problem: Problem
    solved: dict[str, Solved]
    unit: str
    per_second: float
    step: float
    step_text: str


def picture(cases: Sequence[Case]) -> bytes:
    """PNG: for each case a row of wave fronts and a row of errors; all cases have the same methods."""
    methods = [eikonal.METHODS[name] for name in cases[0].solved]
    # More is done against the error from column to column.
    methods.sort(key=lambda method: (method.order, method.differences))
    names = [method.name for method in methods]
    with drawing():
        figure = new_figure(PANEL_IN[0] * len(names) + 1.4, 2 * PANEL_IN[1] * len(cases) + 0.4)
        figure.suptitle("Wave fronts from one source, and the error of their travel times")
        panels = figure.subplots(2 * len(cases), len(names), squeeze=False)
        for k, case in enumerate(cases):
            draw_fronts(panels[2 * k], case, names)
            draw_errors(panels[2 * k + 1], case, names)
        for axes, method in zip(panels[0], methods, strict=True):
            kind = f"order {method.order}" + ", factored" * method.factored
            axes.set_title(f"{method.name}\n{kind}")
        for axes in panels[::2].flat:
            axes.set_xlabel("")
            axes.tick_params(labelbottom=False)
        return figure_png(figure)


def draw_fronts(row: Sequence[Axes], case: Case, names: Sequence[str]) -> None:
    """Iso-lines of the travel time over the speed, the source as a dot."""
    p = case.problem
    limits = float(p.speed.min()), float(p.speed.max())
    axes_mm = [1e3 * p.spacing * np.arange(n) for n in p.speed.shape]
    maps = []
    for axes, name in zip(row, names, strict=True):
        time = case.solved[name].time
        maps.append(draw(axes, p, p.speed, limits, SPEED, name))
        levels = np.arange(case.step, time.max(), case.step)
        axes.contour(*axes_mm, time.T, levels=levels, colors="#ffffff", linewidths=0.7)
        axes.plot(*(1e3 * p.source), "o", color="#d1495b", markersize=4.5)
    label(row, f"{case.title}\nfronts every {case.step_text}")
    draw_bar(maps, "speed (m/s)")


def draw_errors(row: Sequence[Axes], case: Case, names: Sequence[str]) -> None:
    """Absolute errors in log colour, the ring of receivers as a line."""
    p = case.problem
    worst = max(float(np.percentile(solution.error, 99.9)) for solution in case.solved.values())
    high = case.per_second * worst
    limits = high / 10.0**DECADES, high
    maps = []
    for axes, name in zip(row, names, strict=True):
        solution = case.solved[name]
        rms = case.per_second * float(np.sqrt((solution.ring**2).mean()))
        text = f"{rms:.0f}" if rms >= 100.0 else f"{rms:#.3g}"
        maps.append(draw(axes, p, case.per_second * solution.error, limits, ERROR, ""))
        maps[-1].set_norm(LogNorm(*limits))
        axes.set_title(f"ring rms {text} {case.unit}", fontweight="normal")
        around = np.vstack((p.receivers, p.receivers[:1]))
        axes.plot(*(1e3 * around.T), color=RING, linewidth=0.7, linestyle=(0, (4, 4)))
    label(row, f"{case.title}\nabsolute error")
    draw_bar(maps, f"absolute error ({case.unit})")
    # The style shows no formulas, so powers of ten are written out.
    maps[0].colorbar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, position: f"{value:,g}"))


def draw(
    axes: Axes, p: Problem, image: np.ndarray, limits: tuple[float, float], colours: str, title: str
) -> AxesImage:
    """One panel, in mm."""
    return draw_map(axes, image, (p.spacing,) * 2, (0.0, 0.0), limits, colormap=colours, title=title)


def label(row: Sequence[Axes], text: str) -> None:
    """Name a row at its left; the axis along y is labelled there alone."""
    row[0].set_ylabel(f"{text}\n\ny (mm)")
    for axes in row[1:]:
        axes.set_ylabel("")
        axes.tick_params(labelleft=False)
