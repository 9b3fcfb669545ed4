"""H1: one scan by straight CGLS, pyGIMLi, deepwave and Bentray: error, seconds and processor seconds."""

import importlib
import os
from collections.abc import Iterable
from functools import partial
from pathlib import Path

import numpy as np

import bentray
from bentray_kernels.acquisition import Dataset, Truth, pick
from bentray_kernels.tomography.comparison import at_nodes
from bentray_kernels.tomography.result import GridImage
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import BEST_CONSTANT, WATER_ALONE, Row
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.simulation.request import SAMPLE, PhantomScan
from bentray_workers.simulation.simulation_run import simulate

from ..shared._available import available
from . import _deepwave_peer, _straight_ray_peers, _tomography_peers
from ._sections_picture import Panel, picture
from ._travel_times import TravelTimes
from .reconstruction_peers import Found, timed

# Settings of the peers were chosen on the scan with the noise of seed 1.
SEED = 2
# Of 50, 100, 200, 300 and 400 ns the one with the least error: 29.9 m/s, where the 50 ns of R6 give 32.6.
PYGIMLI_ERROR_S = 3e-7
SIDE_M, NODES = float(SAMPLE["side_m"]), int(SAMPLE["nodes"])

# Compiles and imports before anything is timed; the scan of a quick run too.
TINY = {"nodes": 64, "elements": 36, "emissions": 9, "frequency_hz": 1.2e5}


def times(scan: Path) -> TravelTimes:
    """Travel times picked by Bentray, for the methods that have no picker."""
    return TravelTimes.from_dataset(pick(read_dataset(scan)), NODES, SIDE_M)


def straight_cgls(scan: Path) -> GridImage:
    return on_square(_straight_ray_peers.cgls(times(scan)))


def pygimli(scan: Path) -> GridImage:
    invert = _tomography_peers.pygimli(importlib.import_module("pygimli"), PYGIMLI_ERROR_S)
    return on_square(invert(times(scan)))


def deepwave(scan: Path) -> GridImage:
    start = _straight_ray_peers.cgls(times(scan))
    return on_square(_deepwave_peer.full_waveforms(read_dataset(scan), start, SIDE_M))


def bentray_image(scan: Path, method: str) -> GridImage:
    result = bentray.reconstruct(scan, method, progress=False, attenuation=False)
    return result.image.image("speed")


# Name to (module, function) of each method, in the order of the table.
METHODS = {
    "straight CGLS": ("scipy.sparse", lambda _: straight_cgls),
    "pyGIMLi": ("pygimli", lambda _: pygimli),
    "deepwave": ("deepwave", lambda _: deepwave),
    "Bentray auto": ("bentray", lambda _: partial(bentray_image, method="auto")),
    "Bentray waveform": ("bentray", lambda _: partial(bentray_image, method="waveform")),
}
# Each of ours against the peers that use as much of the scan, travel times or traces.
RIVALS = {"Bentray auto": ("straight CGLS", "pyGIMLi"), "Bentray waveform": ("deepwave",)}


def on_square(speed) -> GridImage:
    """An image of which the first and last nodes lie on the border of the sample scan's square."""
    spacing = SIDE_M / (len(speed) - 1)
    return GridImage(speed, (spacing, spacing), (-0.5 * SIDE_M, -0.5 * SIDE_M))


def at_truth(image: GridImage, truth: Truth) -> np.ndarray:
    """The speed at the nodes of the truth, so that one grid judges all images; NaN outside the image."""
    grid, nodes = (image.spacing_m, image.origin_m), (truth.spacing_m, truth.origin_m)
    return at_nodes(image.values, grid, truth.sound_speed_mps.shape, nodes)


def made(context: BenchmarkContext, folder: Path, **changed) -> tuple[Path, Dataset]:
    """A sample scan and its file."""
    asked = PhantomScan(**{**SAMPLE, "seed": SEED, **changed}).chosen()
    dataset = simulate(asked, lambda now: context.progress(now.done, now.total, "waves of the scan"))
    path = folder / f"scan-{len(changed)}.h5"
    write_dataset(path, dataset)
    return path, dataset


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """H1: a row for each method, those of ours over their rivals, and the picture of all images."""
    methods, missing = available(METHODS)
    results, speeds = {}, {}
    with context.temporary_folder() as folder:
        tiny, small = made(context, folder, **TINY)
        scan, dataset = (tiny, small) if context.quick else made(context, folder)
        truth = dataset.truth
        for name, method in methods.items():
            context.progress(len(results), len(methods), name)
            method(tiny)

            def run(name: str = name, method=method) -> np.ndarray:
                return speeds.setdefault(name, at_truth(method(scan), truth))

            results[name] = timed(run, dataset)
    yield from compared(results, missing, dataset)
    panels = [Panel("truth", truth.sound_speed_mps)]
    panels += [Panel(f"{name}\n{results[name].rmse_mps:.1f} m/s", speed) for name, speed in speeds.items()]
    title = "The sample scan by five methods: rms error over the breast"
    context.save_picture("head_to_head.png", lambda: picture(title, panels, 3, SIDE_M))


def compared(results: dict[str, Found], missing: dict[str, str], dataset: Dataset) -> Iterable[Row]:
    """The rows of all methods, and why some are missing."""
    true = dataset.truth.sound_speed_mps[dataset.roi]
    constant = {BEST_CONSTANT: true.mean(), WATER_ALONE: dataset.water_speed_mps}
    errors = {name: float(np.sqrt(((true - speed) ** 2).mean())) for name, speed in constant.items()}
    for name in METHODS:
        theirs = [results[peer].rmse_mps for peer in RIVALS.get(name, ()) if peer in results]
        target, goal = f"H1 {name}: rms error", min(theirs, default=errors[BEST_CONSTANT])
        if name in missing:
            reason = f"{missing[name]}: pip install -e '.[head-to-head]'"
            yield Row(target, None, goal, "<", "m/s", reason)
            continue
        of = results[name]
        figures = {"rms error": of.rmse_mps, "seconds": of.seconds, "processor seconds": of.processor_s}
        detail = f"one run of {of.seconds:.1f} s at load {os.getloadavg()[0]:.0f}"
        yield Row(target, of.rmse_mps, goal, "<", "m/s", detail, baselines=errors, figures=figures)
