"""Errors of every picker on simulated wave scans, against travel times through the true image."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter

from bentray_kernels.acquisition import PICKERS, Dataset, pick
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.simulation.waves import WaveSimulationSettings

from ..shared._recorded_scans import SMALL, other_scan, wave_scan
from ._ideal_times import ideal

# Full width of the average of the slowness by a pulse, wavelengths: its Fresnel zone.
SEEN_WAVELENGTHS = 2.0
WIDTH_OVER_SIGMA = 2.355

# Pairs nearer than this, m, cross only water.
NEAREST_M = 0.01


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Median, MAD, 95 % quantile and picked fraction for each picker."""
    name, dataset = scan(context.quick, context.progress)
    true = blurred_times(dataset)
    for count, picker in enumerate(PICKERS):
        context.progress(count, len(PICKERS), f"picking, {picker}")
        yield from pick_rows(f"picks {name}, {picker}", pick(dataset, picker).delta_tof_s, true, dataset)


def scan(quick: bool, progress: Step) -> tuple[str, Dataset]:
    """The external scan if present; else, and in a quick run, a simulated one."""
    for _, dataset in () if quick else other_scan():
        return "ring_wave_a", dataset
    return wave_scan(SMALL if quick else WaveSimulationSettings(), progress, "simulating waves")


def blurred_times(dataset: Dataset) -> np.ndarray:
    """(ntx, nrx), s: object minus water through the true image, blurred to the width of the Fresnel zone."""
    assert dataset.truth is not None
    assert dataset.center_frequency_hz is not None
    truth = dataset.truth
    wavelength = dataset.water_speed_mps / dataset.center_frequency_hz
    sigma = SEEN_WAVELENGTHS * wavelength / WIDTH_OVER_SIGMA / truth.spacing_m[0]
    wide = 1.0 / gaussian_filter(1.0 / truth.sound_speed_mps, sigma)
    return ideal(replace(dataset, truth=replace(truth, sound_speed_mps=wide)))


def pick_rows(label: str, picks: np.ndarray, true: np.ndarray, dataset: Dataset) -> Iterable[Row]:
    """The rows of one set of picks."""
    assert dataset.center_frequency_hz is not None
    period = 1e9 / dataset.center_frequency_hz
    asked = dataset.distance_m() > NEAREST_M
    error = 1e9 * (picks - true)[asked]
    finite = error[np.isfinite(error)]
    middle = float(np.median(finite))
    spread = 1.4826 * float(np.median(np.abs(finite - middle)))
    far = float(np.percentile(np.abs(finite), 95.0))
    rms = float(np.sqrt(np.mean(finite**2)))
    detail = f"{finite.size} of {error.size} pairs, rms {rms:.0f} ns, period {period:.0f} ns"
    yield Row(f"{label}, median", abs(middle), 0.02 * period, "<=", "ns", detail)
    yield Row(f"{label}, MAD", spread, 0.05 * period, "<=", "ns", detail)
    yield Row(f"{label}, 95 %", far, 0.2 * period, "<=", "ns", detail)
    yield Row(f"{label}, picked", finite.size / error.size, 0.9, ">=", "of pairs", detail)
