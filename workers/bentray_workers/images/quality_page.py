"""Quality page of a scan: gathers with picks, matrix of times, excluded pairs with reasons, findings."""

import textwrap
from itertools import cycle
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.quality import Examined, Finding

from .canvas import drawing, new_figure, to_png
from .curves import LINES, legend_below
from .maps import DIFFERENCE, MISSING, draw_bar, symmetric_limits

# Size of the page, inches, and line length of the list of findings.
PAGE_IN = (13.0, 8.4)
LETTERS = 62

# Findings in the list; further ones are counted.
MAX_FINDINGS = 14

# Part of the peak of a trace that is shown as full black or white.
GATHER_FULL = 0.5

LEFT_OUT = "#f2f2f2"
UNREAD = "#b8b8b8"
NO_TIME = "no time"


def quality_png(dataset: Dataset, examined: Examined, index: int | None = None) -> bytes:
    """One page about one slice.

    Args:
        dataset: the slice as it was examined; its traces may be ``Emissions``.
        examined: report of the scan, and the picked dataset.
        index: of the slice; None: a scan without slices.
    """
    picked = None if examined.picked is None else examined.picked.slice(index or 0)
    findings = [f for f in examined.report.findings if f.slice == (index or 0)]
    with drawing():
        figure = new_figure(*PAGE_IN)
        title = dataset.title or "Scan"
        which = "" if index is None else f", slice {index}"
        figure.suptitle(f"Quality of {textwrap.shorten(title, 80)}{which}: {examined.report.verdict}")
        panels = figure.subplots(2, 3)
        emission = _best_emission(dataset, picked)
        _gather(panels[0, 0], dataset, picked, emission, "object")
        _gather(panels[0, 1], dataset, picked, emission, "water")
        _matrix(panels[0, 2], picked)
        _histogram(panels[1, 0], picked)
        _reasons(panels[1, 1], dataset, picked, findings)
        _list(panels[1, 2], examined, findings)
        return to_png(figure)


def _best_emission(dataset: Dataset, picked: Dataset | None) -> int:
    """The emission with the most picks."""
    if picked is None:
        return len(dataset.tx) // 2
    return int(np.isfinite(picked.differential_tof()).sum(axis=1).argmax())


def _gather(axes: Axes, dataset: Dataset, picked: Dataset | None, emission: int, which: str) -> None:
    traces: NDArray[Any] | None = None if dataset.waveform is None else getattr(dataset.waveform, which)
    axes.set_title(f"{which.capitalize()}, emission {emission}")
    if traces is None or dataset.sampling_rate_hz is None:
        _absent(axes, f"no {which} traces")
        return
    shot = np.asarray(traces[emission], dtype=np.float64)
    shot = np.where(np.isfinite(shot), shot, 0.0)
    shot -= np.median(shot, axis=1, keepdims=True)
    peak = np.abs(shot).max(axis=1, keepdims=True)
    shot = np.divide(shot, peak, out=np.zeros_like(shot), where=peak > 0.0)
    t0, step = 1e6 * dataset.t0_s, 1e6 / dataset.sampling_rate_hz
    extent = (-0.5, shot.shape[0] - 0.5, t0 + step * (shot.shape[1] - 0.5), t0 - 0.5 * step)
    axes.imshow(shot.T, cmap="gray", vmin=-GATHER_FULL, vmax=GATHER_FULL, aspect="auto", extent=extent)
    straight = 1e6 * dataset.distance_m()[emission] / dataset.water_speed_mps
    receivers = np.arange(shot.shape[0])
    axes.plot(receivers, straight, ".", color=LINES[1], markersize=2, label="straight in water")
    if which == "object" and picked is not None:
        arrival = straight + 1e6 * picked.differential_tof()[emission]
        axes.plot(receivers, arrival, ".", color=LINES[0], markersize=2, label="straight + picked difference")
    axes.set_xlim(extent[0], extent[1])
    axes.set_ylim(extent[2], extent[3])
    axes.set_xlabel("receiver (index)")
    axes.set_ylabel("time (µs)", labelpad=1)
    legend_below(axes, markerscale=4.0)


def _matrix(axes: Axes, picked: Dataset | None) -> None:
    axes.set_title("Object minus water")
    if picked is None:
        _absent(axes, "rejected before picking")
        return
    delta = 1e6 * picked.differential_tof()
    low, high = symmetric_limits([delta])
    shown = axes.imshow(
        np.ma.masked_invalid(delta),
        cmap=DIFFERENCE,
        vmin=low,
        vmax=high,
        aspect="auto",
        interpolation="nearest",
    )
    axes.set_facecolor(MISSING)
    _pair_axes(axes)
    draw_bar([shown], "object minus water (µs)")


def _histogram(axes: Axes, picked: Dataset | None) -> None:
    axes.set_title("Travel time differences")
    delta = np.array([]) if picked is None else 1e6 * picked.differential_tof()
    delta = delta[np.isfinite(delta)]
    if not delta.size:
        _absent(axes, "no times")
        return
    axes.hist(delta, bins=80, color="#7fa6b8")
    axes.set_xlabel("object minus water (µs)")
    axes.set_ylabel("number of pairs", labelpad=1)
    axes.spines[["top", "right"]].set_visible(False)
    if picked is not None and picked.sigma_s is not None and np.isfinite(picked.sigma_s).any():
        spread = f"{1e9 * float(np.nanmedian(picked.sigma_s)):.0f} ns"
        axes.set_title(f"Travel time differences, picked to {spread}")


def _reasons(axes: Axes, dataset: Dataset, picked: Dataset | None, findings: list[Finding]) -> None:
    """Excluded pairs, coloured by their first reason."""
    axes.set_title("Pairs left out")
    excluding = [f for f in findings if f.action == "left out" and f.pairs is not None]
    names = list(dict.fromkeys(f.check for f in excluding))
    reason = np.zeros((len(dataset.tx), len(dataset.rx)))
    for finding in reversed(excluding):
        reason[finding.pairs] = 1 + names.index(finding.check)
    if picked is not None:
        unread = ~np.isfinite(picked.differential_tof()) & (reason == 0.0)
        unread &= dataset.tx[:, None] != dataset.rx[None, :]
        if unread.any():
            names.append(NO_TIME)
            reason[unread] = len(names)
    if not names:
        _absent(axes, "none")
        return
    colours = [LEFT_OUT, *(colour for colour, _ in zip(cycle(LINES), names, strict=False))]
    if names[-1] == NO_TIME:
        colours[-1] = UNREAD
    axes.imshow(
        reason,
        cmap=ListedColormap(colours),
        vmin=-0.5,
        vmax=len(names) + 0.5,
        aspect="auto",
        interpolation="nearest",
    )
    for index, name in enumerate(names, start=1):
        count = int((reason == index).sum())
        axes.plot([], [], "s", color=colours[index], label=f"{name}: {count}")
    legend_below(axes)
    _pair_axes(axes)


def _list(axes: Axes, examined: Examined, findings: list[Finding]) -> None:
    report = examined.report
    lines = [f"{report.usable} of {report.pairs} pairs usable"]
    if report.picker:
        lines[0] += f", picker {report.picker}"
    lines.append("")
    for finding in findings[:MAX_FINDINGS]:
        elements = ", ".join(map(str, finding.elements[:8])) + (", …" if len(finding.elements) > 8 else "")
        where = f" ({elements})" if elements else ""
        words = f"{finding.check}: {finding.found}{where}. {finding.action.capitalize()}."
        lines += textwrap.wrap(words, LETTERS, subsequent_indent="   ")
    if len(findings) > MAX_FINDINGS:
        lines.append(f"and {len(findings) - MAX_FINDINGS} more")
    if not findings:
        lines.append("No findings by: " + ", ".join(report.checked) + ".")
        lines[-1:] = textwrap.wrap(lines[-1], LETTERS)
    for name, reason in report.not_checked.items():
        lines += textwrap.wrap(f"Not checked: {name}, {reason}.", LETTERS, subsequent_indent="   ")
    axes.set_title("Findings")
    axes.set_axis_off()
    axes.text(0.0, 1.0, "\n".join(lines), transform=axes.transAxes, verticalalignment="top", fontsize=8)


def _pair_axes(axes: Axes) -> None:
    axes.set_xlabel("receiver (index)")
    axes.set_ylabel("emitter (index)", labelpad=1)
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))


def _absent(axes: Axes, why: str) -> None:
    axes.set_axis_off()
    axes.text(0.5, 0.5, why, transform=axes.transAxes, horizontalalignment="center", color="#666666")
