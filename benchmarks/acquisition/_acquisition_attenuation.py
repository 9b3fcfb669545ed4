"""R8 on wave-equation data: attenuation by full-waveform inversion and from amplitudes along rays."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from bentray_kernels.acquisition import Dataset, pick
from bentray_kernels.tomography import Reconstruction, Settings, reconstruct
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.files.dataset import read_dataset
from bentray_workers.images.truth_comparison import compare
from bentray_workers.images.truth_on_grid import on_grid
from bentray_workers.simulation.waves import WaveSimulationSettings

from ._lossy_scan import lossy_scan

# A scan simulated by another solver, not in the repository.
OTHERS = Path(__file__).parents[3] / "shared" / "data" / "ring_wave_a.h5"

# The scan of this frequency is used for its spectra; FWI over so many wavelengths would take minutes.
FINE_HZ = 1e6

# Goal of R8, and the error above which a result is marked as experimental.
GOAL, EXPERIMENTAL = 0.3, 0.15


def rows(quick: bool, progress: Step) -> Iterable[Row]:
    """NRMSE inside the object by FWI and by rays, relative to the true range; quick: only of a small scan."""
    for name, dataset in scans(quick, progress):
        images, took = invert_amplitudes(dataset, 48 if quick else 128, progress), ""
        if dataset.center_frequency_hz != FINE_HZ:
            images["waveforms"], seconds = invert_waveforms(dataset, quick, progress)
            took = f"; {seconds:.0f} core seconds of waveforms"
        found = {way: error(image, dataset) for way, image in images.items()}
        detail = ", ".join(f"{way} {value:.3f}" for way, value in found.items())
        detail += f"; one value everywhere {flat(next(iter(images.values())), dataset):.3f}{took}"
        for way, value in found.items():
            mark = " (experimental)" if value > EXPERIMENTAL else ""
            yield Row(f"R8 waves, {name}, {way}{mark}", value, GOAL, "<=", "of range", detail)


def scans(quick: bool, progress: Step) -> Iterable[tuple[str, Dataset]]:
    """Names and scans with loss, constant or proportional to the frequency."""
    small, usual, fine = (3e5, 0.05, 32, 16, 64), (4e5, 0.08, 64, 32, 128), (FINE_HZ, 0.08, 128, 64, 256)
    asked = [(small, False)] if quick else [(usual, False), (usual, True), (fine, True)]
    for (frequency, side, elements, emissions, nodes), proportional in asked:
        scan = WaveSimulationSettings(frequency, side, elements, emissions, nodes=nodes)
        name = f"simulated {1e-3 * frequency:.0f} kHz{', loss as the frequency' if proportional else ''}"
        yield name, lossy_scan(scan, progress, proportional=proportional)
    if not quick and OTHERS.exists():
        yield "ring_wave_a 400 kHz", read_dataset(OTHERS)


def invert_waveforms(dataset: Dataset, quick: bool, progress: Step) -> tuple[Reconstruction, float]:
    """FWI of the speed, then of the attenuation; and the CPU time, s."""
    settings = Settings.of(method="waveform", nodes=48 if quick else 128, bands=3)
    picked = replace(pick(dataset), waveform=dataset.waveform)
    begun = time.process_time()
    result = reconstruct(picked, settings, lambda now: progress(now.done, now.total, "waveforms"))
    return result, time.process_time() - begun


def invert_amplitudes(dataset: Dataset, nodes: int, progress: Step) -> dict[str, Reconstruction]:
    """Along straight and bent rays: log ratios, these with the focusing of ray tubes off, and by spectra."""
    picked = replace(pick(dataset), waveform=dataset.waveform)
    ways = {
        "ratios": Settings.of(method="sart", nodes=nodes, amplitudes="ratio"),
        "ratios, focusing taken off": Settings.of(
            method="sart", nodes=nodes, amplitudes="ratio", focusing=True
        ),
        "spectra": Settings.of(method="sart", nodes=nodes, amplitudes="spectrum"),
    }
    found: dict[str, Reconstruction] = {}
    for rays in ("straight", "curved"):
        for way, settings in ways.items():
            name = f"{rays} rays, {way}"
            progress(len(found), 2 * len(ways), name)
            found[name] = reconstruct(picked, replace(settings, rays=rays))
    return found


def error(result: Reconstruction, dataset: Dataset) -> float:
    """Root mean square inside the object, over the range that is there (R8)."""
    assert result.attenuation is not None
    true, inside = _true_values(result, dataset)
    return float(np.sqrt(((result.attenuation - true)[inside] ** 2).mean()) / np.ptp(true[inside]))


def flat(result: Reconstruction, dataset: Dataset) -> float:
    """As ``error`` for a constant image with the true mean."""
    true, inside = _true_values(result, dataset)
    return float(true[inside].std() / np.ptp(true[inside]))


def _true_values(result: Reconstruction, dataset: Dataset) -> tuple[np.ndarray, np.ndarray]:
    """True attenuation at the image's nodes, and which of them count."""
    assert dataset.truth is not None
    assert dataset.truth.attenuation_np_m is not None
    inside = compare(result, dataset.truth, dataset.roi).region
    return on_grid(dataset.truth.attenuation_np_m, dataset.truth, result), inside
