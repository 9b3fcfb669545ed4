"""Comparison of several reconstructions with one truth: images, differences, convergence."""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from bentray_kernels.acquisition import Truth
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Reconstruction
from bentray_kernels.tomography.comparison import Comparison, NotComparable, compare

from .canvas import drawing, new_figure, to_png
from .captions import LABELS, slice_caption
from .curves import draw_history
from .cut import cut, slice_index
from .maps import DIFFERENCE, SPEED, Limits, draw_bar, draw_map, robust_limits, symmetric_limits

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

PANEL_IN = (4.3, 3.9)


def comparison_png(truth: Truth, results: Mapping[str, Reconstruction], roi: Bools | None = None) -> bytes:
    """The phantom beside each reconstruction, their differences on one scale, and the convergence of all.

    The errors in the titles are those of ``compare``; its region is outlined. The title of the phantom has
    that of the best constant speed.

    Args:
        truth: on axes x, y[, z].
        results: by the name to show, at least one; of several slices the middle one is shown.
        roi: region for the errors, on the grid of the truth.

    Raises:
        InvalidInput: without results, or for a truth that does not match their grid.
    """
    if not results:
        raise InvalidInput("results", "none", "at least one reconstruction")
    comparisons = {name: _compare(name, result, truth, roi) for name, result in results.items()}
    limits = robust_limits([compared.other[compared.region] for compared in comparisons.values()])
    spread = symmetric_limits([compared.difference[compared.region] for compared in comparisons.values()])
    finest = max(results, key=lambda name: results[name].speed.size)
    first, compared = results[finest], comparisons[finest]
    with drawing():
        columns = 1 + len(results)
        figure = new_figure(PANEL_IN[0] * columns + 0.6, 2.0 * PANEL_IN[1] + 0.6)
        water = f"Images of a phantom in water of {first.water_speed_mps:.0f} m/s"
        figure.suptitle(water + slice_caption(first, slice_index(first)))
        figure.supxlabel(f"Errors in: {compared.region_choice}", fontsize=8, color="#666666")
        top, bottom = figure.subplots(2, columns)
        title = f"Phantom\nbest constant: {compared.statistics()[1].spread:.1f} m/s rms"
        phantom = _panel(top[0], first, compared, compared.other, limits, SPEED, title)
        speeds, differences = [phantom], []
        draw_history(bottom[0], {name: result.history for name, result in results.items()})
        for upper, lower, (name, result) in zip(top[1:], bottom[1:], results.items(), strict=True):
            errors, shown = comparisons[name], name.capitalize()
            title = f"{shown}\n{errors.caption()}"
            speeds.append(_panel(upper, result, errors, result.speed, limits, SPEED, title))
            differences.append(
                _panel(lower, result, errors, errors.difference, spread, DIFFERENCE, f"{shown} minus phantom")
            )
        draw_bar(speeds, LABELS["speed"])
        draw_bar(differences, "difference (m/s)")
        return to_png(figure)


def _compare(name: str, result: Reconstruction, truth: Truth, roi: Bools | None) -> Comparison:
    try:
        return compare(result, truth, roi)
    except NotComparable as reason:
        raise InvalidInput(
            "truth",
            f"one that does not fit the result {name!r}: {reason}",
            "a truth on the nodes of each result",
        ) from reason


def _panel(
    axes: Axes,
    result: Reconstruction,
    compared: Comparison,
    volume: Floats,
    limits: Limits,
    colormap: str,
    title: str,
) -> AxesImage:
    k = slice_index(result)
    grid = (result.spacing_m, result.origin_m)
    outline = cut(compared.region, k)
    return draw_map(axes, cut(volume, k), *grid, limits, colormap=colormap, title=title, outline=outline)
