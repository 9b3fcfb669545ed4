"""Figure of full-waveform inversion: a gather with picks, and all images with errors and times."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes

from bentray_kernels.acquisition import PICKERS, Dataset, Waveform, pick
from bentray_workers.images.canvas import drawing, new_figure

from ..any_scan._images_beside_truth import draw_beside_truth
from ..shared._pictures import figure_png
from ..shared._reconstruction_on_workers import Made

SHOWN = ("straight", "bent, finite frequency", "waveform")

# Width of the gather's panel relative to an image.
GATHER_WIDTH = 1.9

# Of each picker's marks, and their sizes, points.
MARKS = ("#e6194b", "#ffe119", "#3cb44b", "#4363d8", "#f58231", "#42d4f4")
SIZES = (4.5, 3.9, 3.3, 2.7, 2.1, 1.5)


def picture(scans: Mapping[str, tuple[Dataset, Mapping[str, Made]]], seconds: str) -> bytes:
    """PNG.

    Args:
        scans: by name, the dataset with its traces, and images.
        seconds: what they are seconds of.
    """
    with drawing():
        figure = new_figure(15.0, 3.3 * len(scans) + 0.6)
        figure.suptitle(f"Images from raw traces; {seconds}")
        widths = [GATHER_WIDTH, *(1.0 for _ in range(1 + len(SHOWN)))]
        panels = figure.subplots(len(scans), len(widths), squeeze=False, width_ratios=widths)
        for row, (name, (dataset, images)) in zip(panels, scans.items(), strict=True):
            gather(row[0], name, dataset)
            draw_beside_truth(row[1:], "truth", dataset, {way: images[way] for way in SHOWN}, "\n")
            same_extent(row[1:])
        # One for all gathers, outside the data.
        marks = panels[-1][0].legend(
            loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3, frameon=False, title="picks"
        )
        for mark in marks.legend_handles:
            mark.set_markersize(5.0)
        return figure_png(figure)


def same_extent(panels: Sequence[Axes]) -> None:
    """All panels show what is in each of them."""
    left, right = zip(*(axes.get_xlim() for axes in panels), strict=True)
    low, high = zip(*(axes.get_ylim() for axes in panels), strict=True)
    for axes in panels:
        axes.set(xlim=(max(left), min(right)), ylim=(max(low), min(high)))


def gather(axes: Axes, name: str, dataset: Dataset) -> None:
    """The traces of the first emission around their arrival in water, with the picks of each picker."""
    assert dataset.waveform is not None
    assert dataset.sampling_rate_hz is not None
    assert dataset.center_frequency_hz is not None
    water = dataset.distance_m()[0] / dataset.water_speed_mps
    scan, period = first_emission(dataset), 1.0 / dataset.center_frequency_hz
    picks = {picker: pick(scan, picker).differential_tof()[0] for picker in PICKERS}
    every = np.stack(list(picks.values()))
    late = np.arange(np.nanmin(every) - 2.0 * period, np.nanmax(every) + 4.0 * period, 0.05 * period)
    samples = dataset.t0_s + np.arange(dataset.waveform.object.shape[-1]) / dataset.sampling_rate_hz
    shifted = np.stack(
        [
            np.interp(arrival + late, samples, trace)
            for arrival, trace in zip(water, dataset.waveform.object[0], strict=True)
        ]
    )
    shifted /= np.abs(shifted).max(axis=1, keepdims=True) + 1e-300
    extent = (0, len(shifted), 1e6 * late[0], 1e6 * late[-1])
    axes.imshow(shifted.T, aspect="auto", origin="lower", cmap="gray", vmin=-0.8, vmax=0.8, extent=extent)
    # Smaller marks above larger ones, so that equal picks remain visible.
    for (picker, times), colour, size in zip(picks.items(), MARKS, SIZES, strict=True):
        receivers = np.arange(len(times)) + 0.5
        axes.plot(
            receivers, 1e6 * times, "o", color=colour, markersize=size, markeredgewidth=0.0, label=picker
        )
    axes.set_title(name)
    axes.set_xlabel("receiver")
    axes.set_ylabel("time less that in water (µs)")
    axes.set_ylim(1e6 * late[0], 1e6 * late[-1])


def first_emission(dataset: Dataset) -> Dataset:
    """The dataset with its first emission alone."""
    traces = dataset.waveform
    assert traces is not None
    scales = [None if scale is None else scale[:1] for scale in (traces.object_scale, traces.water_scale)]
    water = None if traces.water is None else traces.water[:1]
    return replace(
        dataset,
        tx=dataset.tx[:1],
        valid=None if dataset.valid is None else dataset.valid[:1],
        waveform=Waveform(traces.object[:1], water, traces.scale, *scales),
    )
