"""Report of one reconstruction: images, convergence, residuals and, with a truth, errors."""

import textwrap
from collections.abc import Iterator

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bentray_kernels.acquisition import Truth
from bentray_kernels.tomography import Reconstruction
from bentray_kernels.tomography.comparison import Comparison, NotComparable, compare
from bentray_kernels.tomography.model_selection.selection import advice_of

from .canvas import drawing, new_figure, to_png
from .captions import LABELS, NAMES, facts, slice_caption, stage_names
from .curves import draw_history, draw_profiles
from .cut import cut, has_section, slice_index
from .maps import (
    ATTENUATION,
    COVERAGE,
    DIFFERENCE,
    FROM_ZERO,
    RECOVERY,
    REFLECTION,
    SPEED,
    UNCERTAINTY,
    Limits,
    draw_bar,
    draw_map,
    robust_limits,
    symmetric_limits,
)
from .residuals import draw_residuals
from .slice import usual_limits

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

PANEL_IN = (4.4, 3.5)

# Rows and columns by the largest number of panels.
GRIDS = {3: (1, 3), 4: (2, 2), 6: (2, 3), 8: (2, 4), 9: (3, 3), 12: (3, 4)}

# Characters per inch of the line under the panels.
CHARACTERS_AN_INCH = 15

# Characters of a line under a panel.
CAPTION = 55

# Of the first line of a doubtful result.
DOUBT = "#b00020"

COLORMAPS = {
    "coverage": COVERAGE,
    "recovery": RECOVERY,
    "uncertainty": UNCERTAINTY,
    "reflection": REFLECTION,
    "attenuation": ATTENUATION,
}


def report_png(result: Reconstruction, truth: Truth | None = None, roi: Bools | None = None) -> bytes:
    """Images, convergence and residuals; with a truth also the truth, the difference and a profile.

    Of several slices the middle one is shown, and with many evenly spaced slices a vertical section, which
    replaces the profile. The errors are those of ``compare``, over all slices. A truth that cannot be
    compared is shown with the reason.

    Args:
        result: to show.
        truth: of the scan.
        roi: region for the errors, on the grid of the truth.
    """
    k = slice_index(result)
    if truth is None:
        return _plain(result, k)
    try:
        return _compared(result, compare(result, truth, roi), k)
    except NotComparable as why:
        return _with_truth(result, truth, str(why), k)


def _plain(result: Reconstruction, k: int) -> bytes:
    with drawing():
        figure, panels = _sheet(result, k, 1 + has_section(result))
        _speed(next(panels), result, k)
        if has_section(result):
            _section(next(panels), result, usual_limits("speed", result.speed, result.coverage))
        _maps(panels, result, k)
        _curves(panels, result)
        return to_png(figure)


def _with_truth(result: Reconstruction, truth: Truth, why: str, k: int) -> bytes:
    with drawing():
        figure, panels = _sheet(result, k, 2)
        _speed(next(panels), result, k)
        axes, image = next(panels), cut(truth.sound_speed_mps, truth.sound_speed_mps.shape[-1] // 2)
        grid = (truth.spacing_m, truth.origin_m)
        shown = draw_map(axes, image, *grid, robust_limits([image]), colormap=SPEED, title="Truth")
        draw_bar([shown], LABELS["speed"])
        axes.set_xlabel(f"x (mm)\nnot compared: {why}")
        _maps(panels, result, k)
        _curves(panels, result)
        return to_png(figure)


def _compared(result: Reconstruction, comparison: Comparison, k: int) -> bytes:
    speed, true_speed = cut(result.speed, k), cut(comparison.other, k)
    region = cut(comparison.region, k)
    grid = (result.spacing_m, result.origin_m)
    difference = speed - true_speed
    # A slice may lie outside the region; it is then shown where the truth covers it.
    within = region if region.any() else np.isfinite(true_speed)
    limits = robust_limits([speed, true_speed], within)
    with drawing():
        figure, panels = _sheet(result, k, 4)
        maps = [
            draw_map(next(panels), image, *grid, limits, colormap=SPEED, title=title, outline=region)
            for title, image in (("Reconstruction", speed), ("Truth", true_speed))
        ]
        draw_bar(maps, LABELS["speed"])
        axes = next(panels)
        spread = symmetric_limits([difference[within]])
        title = f"Difference: {comparison.caption()}"
        shown = draw_map(axes, difference, *grid, spread, colormap=DIFFERENCE, title=title, outline=region)
        draw_bar([shown], "reconstruction minus truth (m/s)")
        axes.set_xlabel(f"x (mm)\nerrors in: {comparison.region_choice}")
        if has_section(result):
            _section(next(panels), result, limits)
        else:
            _profile(next(panels), result, speed, true_speed)
        _maps(panels, result, k)
        _curves(panels, result)
        return to_png(figure)


def _profile(axes: Axes, result: Reconstruction, speed: Floats, true_speed: Floats) -> None:
    row = speed.shape[1] // 2
    x = result.origin_m[0] + result.spacing_m[0] * np.arange(speed.shape[0], dtype=np.float64)
    lines = {"truth": true_speed[:, row], "reconstruction": speed[:, row]}
    draw_profiles(axes, x, lines, f"Along y = {_y_mm(result, row):.1f} mm")


def _section(axes: Axes, result: Reconstruction, limits: Limits) -> None:
    """Vertical section of the speed, across y."""
    row = result.speed.shape[1] // 2
    grid = result.spacing_m[::2], result.origin_m[::2]
    title = f"Reconstruction, y = {_y_mm(result, row):.1f} mm"
    shown = draw_map(axes, result.speed[:, row], *grid, limits, colormap=SPEED, title=title, up="z")
    # Square like the other panels, so that they are aligned.
    left, right, bottom, top = shown.get_extent()
    reach = 0.5 * max(right - left, top - bottom)
    axes.set_xlim(0.5 * (left + right) - reach, 0.5 * (left + right) + reach)
    axes.set_ylim(0.5 * (bottom + top) - reach, 0.5 * (bottom + top) + reach)
    draw_bar([shown], LABELS["speed"])


def _y_mm(result: Reconstruction, row: int) -> float:
    return 1e3 * (result.origin_m[1] + result.spacing_m[1] * row)


def _sheet(result: Reconstruction, k: int, own: int) -> tuple[Figure, Iterator[Axes]]:
    """A sheet for ``own`` panels and for those of ``_maps`` and ``_curves``."""
    count = own + len(_quantities(result)) + 1 + (result.residuals is not None)
    rows, columns = next(grid for most, grid in GRIDS.items() if count <= most)
    figure = new_figure(PANEL_IN[0] * columns, PANEL_IN[1] * rows + 0.6)
    line = int(CHARACTERS_AN_INCH * figure.get_figwidth())
    figure.suptitle(f"Sound speed{slice_caption(result, k)}")
    if result.doubt:
        text = "\n".join(textwrap.wrap(result.doubt, line))
        figure.suptitle(f"{text}\nSound speed{slice_caption(result, k)}", color=DOUBT, fontsize=9)
    words = textwrap.wrap(advice_of(result), line)
    figure.supxlabel("\n".join([facts(result), *words]), fontsize=8, color="#666666")
    panels = figure.subplots(rows, columns).ravel()
    for blank in panels[count:]:
        blank.remove()
    return figure, iter(panels)


def _quantities(result: Reconstruction) -> list[str]:
    """Quantities of the result other than the speed."""
    return [name for name in COLORMAPS if getattr(result, name) is not None]


def _speed(axes: Axes, result: Reconstruction, k: int) -> None:
    speed, grid = cut(result.speed, k), (result.spacing_m, result.origin_m)
    limits = usual_limits("speed", speed, cut(result.coverage, k))
    draw_bar([draw_map(axes, speed, *grid, limits, colormap=SPEED, title="Reconstruction")], LABELS["speed"])


def _maps(panels: Iterator[Axes], result: Reconstruction, k: int) -> None:
    for name in _quantities(result):
        whole = result.image(name)
        assert whole is not None
        image, grid = cut(whole.values, k), (whole.spacing_m, whole.origin_m)
        limits = usual_limits(name, image, None if name in FROM_ZERO else cut(result.coverage, k))
        axes = next(panels)
        shown = draw_map(axes, image, *grid, limits, colormap=COLORMAPS[name], title=NAMES[name])
        draw_bar([shown], LABELS[name])
        if name == "attenuation" and (text := result.caution(name)):
            axes.set_xlabel(f"x (mm)\n{textwrap.fill(text, CAPTION)}")


def _curves(panels: Iterator[Axes], result: Reconstruction) -> None:
    draw_history(next(panels), {"residual": result.history}, stage_names(result))
    if result.residuals is not None:
        draw_residuals(next(panels), result.residuals, result.residual_rms_s)
