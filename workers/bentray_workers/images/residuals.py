"""Histogram panel of the residuals of the last iteration."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from numpy.typing import NDArray

from bentray_kernels.tomography.result import RESIDUAL_EDGES_S, residual_within

Counts = NDArray[np.int64]
Floats = NDArray[np.float64]

# Bins closer to zero than this part of the linear range are drawn as one.
FINEST = 0.25

# Part of the residuals at each end outside the panel.
CUT_OFF = 0.0005

BAR = "#7fa6b8"


def draw_residuals(axes: Axes, counts: Counts, rms_s: float | None) -> None:
    """Histogram on an axis in ns, linear for two thirds of the residuals and logarithmic beyond.

    The height of a bar is the count over its width on this axis, so that areas are comparable.
    """
    linear = residual_within(counts, 0.68) or RESIDUAL_EDGES_S[-1]
    edges, merged = _merged(counts, linear)
    axes.stairs(merged / np.diff(_axis_position(edges, linear)), 1e9 * edges, fill=True, color=BAR)
    # With this scale the axis is smooth at the end of its linear part.
    axes.set_xscale("symlog", linthresh=1e9 * linear, linscale=0.9 / np.log(10.0))
    reach = 1e9 * max(residual_within(counts, 1.0 - CUT_OFF), 2.0 * linear)
    axes.set_xlim(-reach, reach)
    if rms_s is not None:
        for sign in (-1.0, 1.0):
            axes.axvline(sign * 1e9 * rms_s, color="#555555", linewidth=0.8, linestyle="--")
    axes.set_title("Residuals" if rms_s is None else f"Residuals, {1e9 * rms_s:.3g} ns rms")
    half, most = (f"{float(f'{1e9 * residual_within(counts, share):.2g}'):g}" for share in (0.5, 0.95))
    axes.set_xlabel(f"measured minus predicted (ns)\nhalf within {half}, 95 % within {most} ns")
    axes.set_ylabel("number of pairs (area)", labelpad=1)
    axes.xaxis.set_major_locator(FixedLocator(_ticks(1e9 * linear, reach)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, position: f"{value:g}"))
    axes.yaxis.set_major_locator(NullLocator())
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.set_box_aspect(1.0)


def _merged(counts: Counts, linear: float) -> tuple[Floats, Counts]:
    """Edges and counts with the fine bins around zero merged."""
    outer = np.abs(RESIDUAL_EDGES_S) >= FINEST * linear
    outer[[0, -1]] = True
    before = np.concatenate(([0], np.cumsum(counts)))
    return RESIDUAL_EDGES_S[outer], np.diff(before[outer])


def _axis_position(value: Floats, linear: float) -> Floats:
    """Position of a value on the axis: linear up to ``linear``, logarithmic beyond, and smooth."""
    size = np.abs(value) / linear
    return np.sign(value) * linear * np.where(size <= 1.0, size, 1.0 + np.log(np.maximum(size, 1.0)))


def _ticks(linear: float, reach: float) -> list[float]:
    """0 and round numbers on both sides, from the middle of the linear range."""
    round_numbers = [step * 10.0**power for power in range(-2, 6) for step in (1.0, 3.0)]
    ticks = [value for value in round_numbers if 0.4 * linear <= value <= reach]
    while len(ticks) > 3:
        ticks = ticks[1::2]
    return [*(-value for value in reversed(ticks)), 0.0, *ticks]
