"""N1: the error of the automatic choice over the better of straight and bent SART, also with noise."""

import os
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bentray_kernels.acquisition import Dataset, pick
from bentray_kernels.acquisition.noise import with_noise
from bentray_kernels.phantoms import DetailedBreast, EllipsePhantom
from bentray_kernels.tomography import Reconstruction, Settings
from bentray_kernels.tomography.model_selection.selection import explain_candidates
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.waves import WaveSimulationSettings

from ..any_scan._any_array import arrays, hull_error, simulated
from ..shared._baselines import Images
from ..shared._image_error import ErrorOn, ImageError, object_error
from ..uncertainty._breast_scans import breast_scans
from ._ladder import FAT_MPS, WATER_MPS
from ._phantom_scan import PhantomScan

GOAL = 1.03
SNRS = (None, 30.0, 10.0)
SART = Settings.from_values(method="sart", attenuation=False)
DEFAULT = Settings.from_values(attenuation=False)

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


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Table 6 in two waters with three noises, then scans that chose no setting."""
    nodes, elements = (48, 32) if context.quick else (128, 256)
    for coupling in (FAT_MPS, WATER_MPS):
        for snr in SNRS[-1:] if context.quick else SNRS:
            asked = SimulationSettings(nodes=nodes, elements=elements, coupling_mps=coupling, snr=snr)
            scan = PhantomScan.of_table6(asked, context.progress)
            noise = "exact" if snr is None else f"SNR {snr:g}"
            name = f"Table 6, water {coupling:g} m/s, {noise}"
            yield choice_row(name, scan.dataset, scan.mean_absolute, "% of range", context)
    for name, dataset, error_on in unseen_scans(context):
        yield choice_row(name, dataset, error_on, "m/s", context)


def choice_row(name: str, dataset: Dataset, error_on: ErrorOn, unit: str, context: BenchmarkContext) -> Row:
    """The error by default settings over that of the better image by SART."""
    images = Images.here(dataset, context.progress, name, DEFAULT)
    default, seconds = images.default()
    sart = {rays: images.made(SART.changed(rays=rays)).result for rays in ("straight", "curved")}
    errors = {rays: error_on(image).of(image) for rays, image in sart.items()}
    compared = images.compared(default, error_on)
    detail = (
        f"{compared.error:.2f} {unit}, SART straight {errors['straight']:.2f}, bent {errors['curved']:.2f}; "
        f"{explain_candidates(default.trials)}; {default.speed.shape[0]}² nodes, {seconds:.0f} s at load "
        f"{os.getloadavg()[0]:.0f}"
    )
    target = f"N1 {name}: error of the automatic choice over the better SART"
    return compared.row(target, compared.error / min(errors.values()), GOAL, "<=", "", detail)


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
