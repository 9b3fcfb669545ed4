"""Twelve scans that chose no setting: exact times, noise, an arc, facing lines, and picks from waves."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bentray_kernels.acquisition import Dataset, pick
from bentray_kernels.acquisition.noise import with_noise
from bentray_kernels.phantoms import DetailedBreast, EllipsePhantom
from bentray_kernels.tomography import Reconstruction
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.waves import WaveSimulationSettings

from ..any_scan._any_array import arrays, hull_error, simulated
from ..shared._image_error import ErrorOn, ImageError, object_error
from ..uncertainty._breast_scans import breast_scans

# Of breasts of which no two are alike.
SEED, BREASTS = 2027, 4

EXACT = (
    SimulationSettings("table6-vertical", nodes=96, elements=80, coupling_mps=1460.0),
    SimulationSettings("detailed", nodes=96, elements=80, coupling_mps=1450.0),
)
ARRAYS, ARRAY_SNR = ("arc of 270°", "facing lines"), 20.0

# Phantom of Table 6; picked with the frequency stated, and without.
WAVES = (
    WaveSimulationSettings(3.5e5, 0.07, 64, 32, coupling_mps=1480.0, snr=20.0),
    WaveSimulationSettings(3.5e5, 0.07, 64, 32, coupling_mps=1540.0, snr=20.0),
)
QUICK = SimulationSettings(nodes=48, elements=32, coupling_mps=1460.0, snr=10.0)


class UnseenScan(NamedTuple):
    """A scan and how its images are compared with the truth."""

    name: str
    dataset: Dataset
    error_on: ErrorOn


def unseen_scans(context: BenchmarkContext) -> Iterator[UnseenScan]:
    """The scans; a quick run has one."""
    for asked in (QUICK,) if context.quick else EXACT:
        name = f"{asked.phantom}, water {asked.coupling_mps:g} m/s, {'SNR 10' if asked.snr else 'exact'}"
        dataset = simulate(asked, lambda now, n=name: context.progress(now.done, now.total, n))
        yield UnseenScan(name, dataset, object_error(dataset))
    if context.quick:
        return
    for scan in breast_scans(BREASTS, SEED):
        yield UnseenScan(f"breast {scan.name}", scan.dataset, _inside(scan.breast))
    for number, name in enumerate(ARRAYS):
        exact = simulated(arrays(quick=False)[name])
        random, delta = np.random.default_rng((SEED, number)), exact.differential_tof()
        noisy, _ = with_noise(delta, ARRAY_SNR, random, np.isfinite(delta) & (delta != 0.0))
        dataset = replace(exact, delta_tof_s=noisy)
        yield UnseenScan(f"{name}, SNR {ARRAY_SNR:g}", dataset, hull_error(dataset))
    for waves in WAVES:
        name = f"picks at {1e-3 * waves.frequency_hz:g} kHz, water {waves.coupling_mps:g} m/s, SNR 20"
        recorded = simulate(waves, lambda now, n=name: context.progress(now.done, now.total, n))
        picked = replace(pick(recorded), waveform=None)
        yield UnseenScan(name, picked, object_error(recorded))
        unknown = replace(picked, center_frequency_hz=None)
        yield UnseenScan(f"{name}, frequency unknown", unknown, object_error(recorded))


def _inside(phantom: DetailedBreast | EllipsePhantom) -> ErrorOn:
    """Root mean square error inside a phantom that is centred on 0, m/s."""

    def error_on(image: Reconstruction) -> ImageError:
        nodes = image.speed.shape[0]
        side = image.spacing_m[0] * (nodes - 1)
        return ImageError(phantom.speed(nodes, side), phantom.inside(nodes, side))

    return error_on
