"""Curves: the residual against the sweep, speeds along a line."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator
from numpy.typing import NDArray

from bentray_kernels.tomography import Sweep

Floats = NDArray[np.float64]

LINES = ("#d1495b", "#00798c", "#edae49", "#30638e", "#66a182")

# From this ratio of the highest to the lowest residual on, the axis is logarithmic.
WIDE = 20.0


def draw_history(axes: Axes, histories: Mapping[str, tuple[Sweep, ...]]) -> None:
    """Residual against sweep, a line a name; over slices the root mean square."""
    every: list[float] = []
    for (name, history), colour in zip(histories.items(), cycle(LINES), strict=False):
        sweeps = sorted({s.sweep for s in history})
        rms = [
            1e9 * float(np.sqrt(np.mean([s.residual_rms_s**2 for s in history if s.sweep == sweep])))
            for sweep in sweeps
        ]
        axes.plot(sweeps, rms, "o-", color=colour, linewidth=1.6, markersize=4, label=name)
        every += rms
    slices = {s.slice for history in histories.values() for s in history}
    axes.set_title("Convergence" if len(slices) < 2 else f"Convergence, all {len(slices)} slices")
    axes.set_xlabel("sweep")
    axes.set_ylabel("residual rms (ns)", labelpad=1)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if every and min(every) > 0.0 and max(every) > WIDE * min(every):
        axes.set_yscale("log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, place: f"{value:g}"))
    else:
        axes.set_ylim(0.0, 1.08 * max(every, default=0.0) or 1.0)
    _dress(axes)
    if len(histories) > 1:
        axes.legend()


def draw_profiles(axes: Axes, place_m: Floats, profiles: Mapping[str, Floats], title: str) -> None:
    """Speeds along a line, m/s against mm; the first is the truth."""
    for k, (name, values) in enumerate(profiles.items()):
        colour, width = ("#222222", 1.0) if k == 0 else (LINES[(k - 1) % len(LINES)], 1.6)
        axes.plot(1e3 * place_m, values, color=colour, linewidth=width, label=name)
    axes.set_title(title)
    axes.set_xlabel("x (mm)")
    axes.set_ylabel("sound speed (m/s)", labelpad=1)
    axes.margins(x=0.0)
    _dress(axes)
    axes.legend()


def _dress(axes: Axes) -> None:
    axes.grid(color="#dddddd", linewidth=0.5)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_box_aspect(1.0)
