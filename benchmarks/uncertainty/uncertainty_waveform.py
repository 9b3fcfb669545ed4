"""U1: standard deviations of full-waveform images hold on breasts that chose no parameter, and their time."""

import os
import time
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from bentray_kernels.acquisition import Dataset, pick
from bentray_kernels.arrays import Floats
from bentray_kernels.phantoms import DETAILED_SIDE_M
from bentray_kernels.tomography import Reconstruction, Settings, reconstruct
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row

from ..shared._recorded_scans import with_trace_noise
from ..shared._ring_scan import RingScan
from ._breast_scans import detailed
from ._judged_image import sizes

# Half the size of a breast; the ratio of breast and wavelength is that of 75 kHz at full size.
SIDE_M, RADIUS_M, CENTRE_HZ, ELEMENTS, EMISSIONS, WATER_MPS = 0.12, 0.054, 1.5e5, 64, 32, 1500.0
SCANS, QUICK_SCANS, SNRS = 4, 1, (10.0, 30.0)
PLAN = Settings.from_values(method="waveform", attenuation=False, uncertainty=True)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """Rows of the calibration and of the time."""
    errors, deviations, details, seconds = [], [], [], np.zeros(2)
    for number, scan in enumerate(wave_scans(QUICK_SCANS if context.quick else SCANS, context)):
        begun = time.process_time()
        result = reconstruct(scan, PLAN)
        both = time.process_time() - begun
        begun = time.process_time()
        reconstruct(scan, result.settings.changed(uncertainty=False))
        seconds += both, time.process_time() - begun
        error, deviation = beside_truth(scan, result)
        errors.append(error)
        deviations.append(deviation)
        details.append(f"{number}: {100.0 * np.mean(error <= 2.0 * deviation):.0f} %")
    error, deviation = np.concatenate(errors), np.concatenate(deviations)
    each = "; ".join(details)
    yield Row(
        "U1 full waveform, nodes within two deviations",
        float(np.mean(error <= 2.0 * deviation)),
        0.85,
        ">=",
        "",
        f"{len(details)} scans of {EMISSIONS} emitters at {1e-3 * CENTRE_HZ:.0f} kHz, nodes in the breast; "
        f"{each}; {100.0 * np.mean(error <= deviation):.0f} % within one; {sizes(error, deviation)}",
    )
    yield Row(
        "U1 full waveform, time of image and uncertainty over that of the image",
        float(seconds[0] / seconds[1]),
        2.0,
        "<",
        "",
        f"CPU time, {seconds[1]:.0f} s for the images; load {os.getloadavg()[0]:.1f}",
    )


def wave_scans(count: int, context: BenchmarkContext, centre_hz: float = CENTRE_HZ) -> Iterator[Dataset]:
    """Breasts in water by a finer simulator of another order, with noise, picked."""
    for number in range(count):
        breast = detailed(np.random.default_rng((73, number)), WATER_MPS)
        size = RingScan(
            SIDE_M, RADIUS_M, centre_hz, ELEMENTS, EMISSIONS, breast.speed_range(), WATER_MPS, None
        )
        speed = breast.speed(size.nodes, DETAILED_SIDE_M)
        shots = size.recorded({"object": speed, "water": np.full_like(speed, WATER_MPS)}, context.progress)
        inside = breast.inside(size.nodes, DETAILED_SIDE_M)
        scan = size.dataset(shots["object"], shots["water"], speed, inside)
        noisy = with_trace_noise(scan, SNRS[number % len(SNRS)], seed=number)
        yield replace(pick(noisy), waveform=noisy.waveform)


def beside_truth(scan: Dataset, result: Reconstruction) -> tuple[Floats, Floats]:
    """Absolute errors from the smoothed truth, m/s, and deviations, m/s, of the nodes in the breast."""
    truth, spread = scan.truth, result.uncertainty
    assert truth is not None
    assert spread is not None
    assert scan.roi is not None
    nodes = result.resolution_width_m[0] / truth.spacing_m[0]
    smooth = gaussian_filter(truth.sound_speed_mps, nodes, mode="nearest")
    lines = [
        (result.origin_m[axis] + result.spacing_m[axis] * np.arange(count) - truth.origin_m[axis])
        / truth.spacing_m[axis]
        for axis, count in enumerate(result.speed.shape)
    ]
    points = np.meshgrid(*lines, indexing="ij")
    inside = map_coordinates(scan.roi.astype(float), points, order=0, mode="constant") > 0.5
    inside &= spread > 0.0
    true = map_coordinates(smooth, points, order=1, mode="nearest")
    return np.abs(result.speed - true)[inside], spread[inside]
