"""The residuals of the last sweep: how many lie within what size, and their histogram as a panel."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from numpy.typing import NDArray

from bentray_kernels.tomography import RESIDUAL_EDGES_S

Counts = NDArray[np.int64]
Floats = NDArray[np.float64]

# Bins closer to zero than this part of the linear range are drawn as one.
FINEST = 0.25

# Part of the residuals at each end that the panel does not show.
CUT_OFF = 0.0005

BAR = "#7fa6b8"


def within(counts: Counts, share: float) -> float:
    """The size, s, that this share of the residuals does not exceed; 0 where there are none.

    Args:
        counts: of the bins between ``RESIDUAL_EDGES_S``.
        share: in (0, 1]; in a bin the residuals are taken to lie evenly.
    """
    if not counts.sum():
        return 0.0
    middle = len(counts) // 2
    # Both signs together, from the bin around zero outwards.
    sizes = np.concatenate((counts[middle : middle + 1], counts[middle + 1 :] + counts[middle - 1 :: -1]))
    edges = np.concatenate(([0.0], RESIDUAL_EDGES_S[middle + 1 :]))
    below = np.concatenate(([0.0], np.cumsum(sizes) / counts.sum()))
    k = int(np.searchsorted(below, share - 1e-12)) - 1
    part = (share - below[k]) / (below[k + 1] - below[k])
    return float(edges[k] + part * (edges[k + 1] - edges[k]))


def draw_residuals(axes: Axes, counts: Counts, rms_s: float | None) -> None:
    """The histogram on an axis in ns that is linear where two thirds lie and logarithmic beyond.

    The height of a bar is the count over the bar's width on this axis, so that areas can be compared.
    """
    linear = within(counts, 0.68) or RESIDUAL_EDGES_S[-1]
    edges, merged = _merged(counts, linear)
    axes.stairs(merged / np.diff(_place(edges, linear)), 1e9 * edges, fill=True, color=BAR)
    # With this scale the axis has no kink where its linear part ends.
    axes.set_xscale("symlog", linthresh=1e9 * linear, linscale=0.9 / np.log(10.0))
    reach = 1e9 * max(within(counts, 1.0 - CUT_OFF), 2.0 * linear)
    axes.set_xlim(-reach, reach)
    if rms_s is not None:
        for sign in (-1.0, 1.0):
            axes.axvline(sign * 1e9 * rms_s, color="#555555", linewidth=0.8, linestyle="--")
    axes.set_title("Residuals" if rms_s is None else f"Residuals, {1e9 * rms_s:.3g} ns rms")
    half, most = (f"{float(f'{1e9 * within(counts, share):.2g}'):g}" for share in (0.5, 0.95))
    axes.set_xlabel(f"measured minus predicted (ns)\nhalf within {half}, 95 % within {most} ns")
    axes.set_ylabel("pairs", labelpad=1)
    axes.xaxis.set_major_locator(FixedLocator(_ticks(1e9 * linear, reach)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))
    axes.yaxis.set_major_locator(NullLocator())
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.set_box_aspect(1.0)


def _merged(counts: Counts, linear: float) -> tuple[Floats, Counts]:
    """Edges and counts with the fine bins around zero made one."""
    kept = np.abs(RESIDUAL_EDGES_S) >= FINEST * linear
    kept[[0, -1]] = True
    before = np.concatenate(([0], np.cumsum(counts)))
    return RESIDUAL_EDGES_S[kept], np.diff(before[kept])


def _place(value: Floats, linear: float) -> Floats:
    """Where the axis shows a value: itself up to ``linear``, beyond it its logarithm, without a kink."""
    size = np.abs(value) / linear
    return np.sign(value) * linear * np.where(size <= 1.0, size, 1.0 + np.log(np.maximum(size, 1.0)))


def _ticks(linear: float, reach: float) -> list[float]:
    """0 and round numbers on both sides, from near the middle of the linear range on."""
    round_numbers = [step * 10.0**power for power in range(-2, 6) for step in (1.0, 3.0)]
    wanted = [value for value in round_numbers if 0.4 * linear <= value <= reach]
    while len(wanted) > 3:
        wanted = wanted[1::2]
    return [*(-value for value in reversed(wanted)), 0.0, *wanted]
