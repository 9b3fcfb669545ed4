"""The picture of one reconstruction: speed, coverage, convergence and, with a truth, the errors."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bentray_kernels.acquisition import Truth
from bentray_kernels.tomography import Reconstruction

from ..comparison import Comparison, NotComparable, compare
from .canvas import drawing, new_figure, to_png
from .captions import LABELS, facts, which_slice
from .curves import draw_history, draw_profiles
from .cut import cut, slice_index
from .maps import COVERAGE, DIFFERENCE, SPEED, draw_bar, draw_map, robust_limits, symmetric_limits

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

PANEL_IN = (4.4, 3.5)


def report_png(result: Reconstruction, truth: Truth | None = None, roi: Bools | None = None) -> bytes:
    """Speed, coverage and convergence; with a truth also this, the difference and a profile.

    Several slices are shown by the middle one, the title says which; the errors are those of ``compare``,
    over all slices. A truth that cannot be compared is shown as it is, with the reason under it.

    Args:
        result: what to show.
        truth: what is really there.
        roi: the nodes that count for the errors, on the truth's grid.
    """
    k = slice_index(result)
    if truth is None:
        return _plain(result, k)
    try:
        return _compared(result, compare(result, truth, roi), k)
    except NotComparable as reason:
        return _beside(result, truth, str(reason), k)


def _plain(result: Reconstruction, k: int) -> bytes:
    with drawing():
        figure, panels = _sheet(result, k, 1, 3)
        _speed(next(panels), result, k)
        _coverage(next(panels), result, k)
        draw_history(next(panels), {"residual": result.history})
        return to_png(figure)


def _beside(result: Reconstruction, truth: Truth, reason: str, k: int) -> bytes:
    with drawing():
        figure, panels = _sheet(result, k, 2, 2)
        _speed(next(panels), result, k)
        axes, image = next(panels), cut(truth.sound_speed_mps, truth.sound_speed_mps.shape[-1] // 2)
        grid = (truth.spacing_m, truth.origin_m)
        shown = draw_map(axes, image, *grid, robust_limits([image]), colormap=SPEED, title="Truth")
        draw_bar([shown], LABELS["speed"])
        axes.set_xlabel(f"x (mm)\nnot compared: {reason}")
        _coverage(next(panels), result, k)
        draw_history(next(panels), {"residual": result.history})
        return to_png(figure)


def _compared(result: Reconstruction, found: Comparison, k: int) -> bytes:
    speed, true_speed = cut(result.speed, k), cut(found.true_speed_mps, k)
    region = cut(found.region, k)
    grid = (result.spacing_m, result.origin_m)
    difference = speed - true_speed
    # A slice may lie beyond the region; it is shown by what the truth covers there.
    within = region if region.any() else np.isfinite(true_speed)
    limits = robust_limits([speed, true_speed], within)
    with drawing():
        figure, panels = _sheet(result, k, 2, 3)
        maps = [
            draw_map(next(panels), image, *grid, limits, colormap=SPEED, title=title, outline=region)
            for title, image in (("Reconstruction", speed), ("Truth", true_speed))
        ]
        draw_bar(maps, LABELS["speed"])
        axes = next(panels)
        spread = symmetric_limits([difference[within]])
        title = f"Difference: {found}"
        shown = draw_map(axes, difference, *grid, spread, colormap=DIFFERENCE, title=title, outline=region)
        draw_bar([shown], "reconstruction minus truth (m/s)")
        axes.set_xlabel(f"x (mm)\nerrors read: {found.region_choice}")
        _coverage(next(panels), result, k)
        draw_history(next(panels), {"residual": result.history})
        row = speed.shape[1] // 2
        x = result.origin_m[0] + result.spacing_m[0] * np.arange(speed.shape[0], dtype=np.float64)
        y_mm = 1e3 * (result.origin_m[1] + result.spacing_m[1] * row)
        lines = {"truth": true_speed[:, row], "reconstruction": speed[:, row]}
        draw_profiles(next(panels), x, lines, f"Along y = {y_mm:.1f} mm")
        return to_png(figure)


def _sheet(result: Reconstruction, k: int, rows: int, columns: int) -> tuple[Figure, Iterator[Axes]]:
    figure = new_figure(PANEL_IN[0] * columns, PANEL_IN[1] * rows + 0.6)
    figure.suptitle(f"Sound speed{which_slice(result, k)}")
    figure.supxlabel(facts(result), fontsize=8, color="#666666")
    return figure, iter(figure.subplots(rows, columns).ravel())


def _speed(axes: Axes, result: Reconstruction, k: int) -> None:
    speed, passed = cut(result.speed, k), cut(result.coverage, k) > 0.0
    limits = robust_limits([speed], passed if passed.any() else None)
    grid = (result.spacing_m, result.origin_m)
    draw_bar([draw_map(axes, speed, *grid, limits, colormap=SPEED, title="Reconstruction")], LABELS["speed"])


def _coverage(axes: Axes, result: Reconstruction, k: int) -> None:
    image = cut(result.coverage, k)
    limits = (0.0, robust_limits([image])[1])
    grid = (result.spacing_m, result.origin_m)
    draw_bar([draw_map(axes, image, *grid, limits, colormap=COVERAGE, title="Coverage")], LABELS["coverage"])
