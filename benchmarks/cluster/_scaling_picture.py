"""Figure of scaling: measured and ideal rates, and the utilisation of one scheduler with many workers."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, NullFormatter

from bentray_workers.images.canvas import drawing, new_figure

from ..shared._pictures import figure_png
from ._scaling_cluster import Run
from ._scaling_model import BUSY, Model

COLOURS = ("#1f7a8c", "#d1495b", "#edae49")
WORKERS = np.geomspace(1, 20_000, 200)


def picture(
    models: Sequence[Model], runs: Sequence[Run], slices: Sequence[int], scans: int, many: int
) -> bytes:
    """PNG.

    Args:
        models: fitted to the runs, one a size of scan, with the slices of each.
        runs: with tasks.
        slices: of each scan.
        scans: of a day, whose workers are marked.
        many: workers that are marked, and for which the shortest task is drawn too.
    """
    with drawing():
        figure = new_figure(10.0, 4.4)
        left, right = figure.subplots(1, 2)
        measured(left, runs)
        lengths = [*(model.work.seconds for model in models), models[0].length_for(many)]
        for colour, length in zip(COLOURS, lengths, strict=False):
            share = [models[0].scheduler_share(w, length) for w in WORKERS]
            right.plot(WORKERS, share, color=colour, label=f"scheduler, tasks of {length:.2g} s")
            right.plot(WORKERS, [models[0].driver_share(w, length) for w in WORKERS], "--", color=colour)
        right.plot([], [], "--", color="#444444", label="the service that submits them")
        right.axhline(BUSY, color="#222222", linewidth=1.0)
        right.annotate(f"{100 * BUSY:.0f} % of a processor", (1.1, BUSY * 1.15), fontsize=8)
        marks = {f"{many:,} workers": float(many)}
        for model, count in zip(models, slices, strict=True):
            marks[f"{scans:,} scans of {count} slices a day"] = model.workers_for(scans, count)
        for words, workers in marks.items():
            right.axvline(workers, color="#bbbbbb", linewidth=1.0)
            where = (workers * 1.1, 2e-3 if workers < many else 1.5e-1)
            right.annotate(words, where, rotation=90, fontsize=8, va="bottom")
        right.set(
            xscale="log",
            yscale="log",
            xlim=(1, WORKERS[-1]),
            ylim=(1e-3, 20),
            xlabel="busy workers",
            ylabel="processors busy",
            title="Extrapolated",
        )
        right.legend(loc="lower right", framealpha=1.0, frameon=True, edgecolor="none")
        for axis in (left.yaxis, right.xaxis, right.yaxis):
            axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,g}"))
            axis.set_minor_formatter(NullFormatter())
        return figure_png(figure)


def measured(axes: Axes, runs: Sequence[Run]) -> None:
    """Rates by the number of workers; dotted is what the tasks alone would allow."""
    for colour, length in zip(COLOURS, sorted({run.length for run in runs}, reverse=True), strict=False):
        own = sorted((run.workers, run.tasks / run.seconds) for run in runs if run.length == length)
        workers, rates = zip(*own, strict=True)
        axes.plot(workers, rates, "o", color=colour, label=f"tasks of {1e3 * length:.0f} ms")
        axes.plot(workers, np.array(workers) / length, ":", color=colour)
    axes.plot([], [], ":", color="#444444", label="no overhead")
    axes.set(
        xscale="log",
        yscale="log",
        xlabel="worker processes, all on two cores",
        ylabel="tasks a second",
        title="Measured with sleeping tasks",
    )
    axes.set_xticks([1, 2, 4, 8], ["1", "2", "4", "8"])
    axes.set_yticks([10, 20, 50, 100, 200, 500])
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.legend()
