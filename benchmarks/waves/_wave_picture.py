"""Figure of the wave simulator and k-Wave: traces, differences, delays."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from bentray_workers.images.canvas import drawing, new_figure

from ..shared._pictures import figure_png
from ._wave_shots import CENTRE_HZ, WATER_MPS, Shot, delays, misfit

OURS, THEIRS, LEFT, STATED = "#d1495b", "#9db4c0", "#00798c", "#444444"

# Traces as ours and theirs have them.
Pair = tuple[np.ndarray, np.ndarray]


def picture(shown: Sequence[tuple[Shot, Pair, Pair]]) -> bytes:
    """PNG: a row a shot, its traces as they are, with our dispersion put into both, and delays."""
    with drawing():
        figure = new_figure(12.0, 1.75 * len(shown) + 0.6)
        figure.suptitle("The wave simulator against k-Wave, nothing scaled or shifted to fit")
        panels = figure.subplots(len(shown), 3, squeeze=False, width_ratios=(2, 2, 1.4))
        for row, (shot, raw, refined) in zip(panels, shown, strict=True):
            title = f"{shot.name}, {shot.points:g} nodes a wave"
            across(row[0], f"{title}: {misfit(*raw):.1%}", shot, raw, 1, 0)
            across(
                row[1], f"dispersion put into both: {misfit(*refined):.2%}", shot, refined, 10, shot.spread
            )
            later(row[2], shot, raw, refined)
        for axes in panels[0, :2]:
            axes.legend(loc="upper right", fontsize=7)
        panels[0][2].legend(loc="lower left", fontsize=7)
        for axes in panels[-1, :2]:
            axes.set_xlabel("time after the straight way through water (µs)")
        panels[-1][2].set_xlabel("distance (mm)")
        return figure_png(figure)


def across(axes: Axes, title: str, shot: Shot, pair: Pair, times: int, before: int) -> None:
    """The traces of the receiver opposite the emitter, and so many times their difference.

    They begin ``before`` steps ahead of the record.
    """
    opposite = shot.receivers // 2
    ours, theirs = (traces[opposite] / np.abs(pair[1][opposite]).max() for traces in pair)
    late = 1e6 * (shot.time - before * shot.step - shot.distance[opposite] / WATER_MPS)
    axes.plot(late, theirs, color=THEIRS, linewidth=3.0, label="k-Wave")
    axes.plot(late, ours, color=OURS, linewidth=1.0, label="ours")
    label = "difference" if times == 1 else f"{times} times the difference"
    axes.plot(late, times * (ours - theirs) - 1.4, color=LEFT, linewidth=1.0, label=label)
    axes.set_xlim(-4e6 / CENTRE_HZ, 6e6 / CENTRE_HZ)
    axes.set_ylim(-2.0, 1.6)
    axes.set_yticks([])
    axes.set_title(title)


def later(axes: Axes, shot: Shot, raw: Pair, refined: Pair) -> None:
    """How much later than theirs ours come, by distance, beside what is stated for water."""
    far = 1e3 * shot.distance
    order = np.argsort(far)
    axes.plot(
        far[order], 1e9 * shot.lateness(WATER_MPS)[order], color=STATED, linewidth=1.0, label="stated, water"
    )
    axes.plot(far, 1e9 * delays(*raw, shot.step), ".", color=OURS, markersize=4, label="as they are")
    axes.plot(far, 1e9 * delays(*refined, shot.step), ".", color=LEFT, markersize=4, label="put into both")
    axes.set_ylabel("ours later (ns)")
