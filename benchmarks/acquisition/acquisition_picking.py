"""Errors of every picker on simulated wave scans, against travel times through the true image."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.ndimage import gaussian_filter

from bentray_kernels.acquisition import PICKERS, Dataset, pick
from bentray_kernels.tomography import Settings
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.reconstruction.reconstruction_run import reconstruct
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.waves import WaveSimulationSettings

from ..shared._trace_noise import with_trace_noise
from ._ideal_times import ideal

# A scan simulated by another solver, not in the repository.
OTHERS = Path(__file__).parents[3] / "shared" / "data" / "ring_wave_a.h5"

# Full width of the average of the slowness by a pulse, wavelengths: its Fresnel zone.
SEEN_WAVELENGTHS = 2.0
WIDTH_OVER_SIGMA = 2.355

# Pairs nearer than this, m, cross only water.
NEAREST_M = 0.01

# SNR of the comparison of guided_rows and unguided picks: median peak over standard deviation of the noise.
HARD_SNR = 4.0


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Median, MAD, 95 % quantile and picked fraction for each picker; then guided picks in noise."""
    name, dataset = scan(context.quick, context.progress)
    true = blurred_times(dataset)
    for count, picker in enumerate(PICKERS):
        context.progress(count, len(PICKERS), f"picking, {picker}")
        yield from pick_rows(f"picks {name}, {picker}", pick(dataset, picker).delta_tof_s, true, dataset)
    yield from guided_rows(name, dataset, true)


def scan(quick: bool, progress: Step) -> tuple[str, Dataset]:
    """The external scan if present; else, and in a quick run, a simulated one."""
    if OTHERS.exists() and not quick:
        return "ring_wave_a", read_dataset(OTHERS)
    asked = WaveSimulationSettings(3e5, 0.05, 32, 16, nodes=64) if quick else WaveSimulationSettings()
    made = simulate(asked, lambda now: progress(now.done, now.total, "simulating waves"))
    return f"simulated {1e-3 * asked.frequency_hz:.0f} kHz", made


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


def guided_rows(name: str, dataset: Dataset, true: np.ndarray) -> Iterable[Row]:
    """In noise: rms error of guided picks over that of unguided ones."""
    assert dataset.waveform is not None
    far = dataset.distance_m() > 0.9 * dataset.distance_m().max()
    peak = float(np.median(np.abs(dataset.waveform.object[far]).max(axis=-1)))
    noisy = with_trace_noise(dataset, HARD_SNR, peak)
    errors = [1e9 * (picked.delta_tof_s - true) for picked in (pick(noisy), guided_picks(noisy))]
    rms = [float(np.sqrt(np.nanmean(error**2))) for error in errors]
    pairs = [int(np.isfinite(error).sum()) for error in errors]
    detail = (
        f"trace SNR {HARD_SNR:g}: alone {rms[0]:.0f} ns, {pairs[0]} pairs; guided {rms[1]:.0f} ns, {pairs[1]}"
    )
    yield Row(f"picks {name}, guided rms over alone", rms[1] / rms[0], 1.0, "<=", "", detail)
    yield Row(f"picks {name}, guided count over alone", pairs[1] / pairs[0], 1.0, ">=", "", detail)


def guided_picks(dataset: Dataset) -> Dataset:
    """The dataset as picked in the last of two rounds near the times that an image predicts."""
    settings = Settings.of(
        method="gauss-newton", rays="straight", attenuation=False, nodes=64, examine=False, guided_rounds=2
    )
    with TemporaryDirectory() as folder:
        scan_file, work_dir = Path(folder) / "scan.h5", Path(folder) / "work"
        write_dataset(scan_file, dataset)
        reconstruct(None, scan_file, settings, work_dir=work_dir)
        return read_dataset(sorted(work_dir.glob("*-picked.h5"))[-1])
