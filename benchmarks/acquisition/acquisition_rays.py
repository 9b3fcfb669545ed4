"""R4 and R7: bent against straight rays on the same picks; the default settings against straight rays."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from bentray_kernels.acquisition import Dataset, pick
from bentray_kernels.tomography import Settings, reconstruct
from bentray_kernels.tomography.model_selection.finite_frequency_candidates import finite_frequency_candidates
from bentray_kernels.tomography.model_selection.selection import explain_candidates
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import STRAIGHT_RAYS, Row
from bentray_workers.files.dataset import read_dataset
from bentray_workers.simulation.waves import WaveSimulationSettings

from ..shared._baselines import Images
from ..shared._image_error import object_error
from ..shared._recorded_scans import OTHERS, SMALL, other_scan, wave_scan, with_trace_noise
from ._ideal_times import ideal
from ._registration import registered, registered_error

# A measurement that is not in the repository.
MEASURED = OTHERS.with_name("openust_measured.h5")

# Phantom of Table 6. A scan of f Hz on a side of s m is equivalent to one of 2·f on s/2, so that sides are
# chosen by the cost of the simulation: 40, 78 and 91 wavelengths across the ring.
SCANS = (
    WaveSimulationSettings(5e5, 0.12, 128, 64),
    WaveSimulationSettings(1e6, 0.12, 128, 32),
    WaveSimulationSettings(2e6, 0.07, 128, 16),
)
SNRS = (np.inf, 30.0, 10.0)

# Radius of the region in which the authors of the measurement evaluate their error, m.
RADIUS_M = 0.0675


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """R4 for each scan and noise; R7, unless quick."""
    for asked in (SMALL,) if context.quick else SCANS:
        name = f"simulated {1e-3 * asked.frequency_hz:.0f} kHz, {1e3 * asked.side_m:.0f} mm"
        _, clean = wave_scan(asked, context.progress, name)
        for snr in (30.0,) if context.quick else SNRS:
            detail = name + (f", SNR {snr:g}" if snr < np.inf else ", no noise")
            yield from scan_rows(detail, with_trace_noise(clean, snr))
    for scan in () if context.quick else other_scan():
        yield from scan_rows(*scan)
    yield from measured(context.quick)


def scan_rows(name: str, dataset: Dataset) -> Iterable[Row]:
    """Bent over straight rays by the same method, penalty and width; and the default settings over straight.

    Ideal times are a yardstick only where they give a better image than the picks by the same rays.
    """
    picked = pick(dataset)
    images = Images(picked, reconstruct)
    error_on = object_error(dataset)
    plan = Settings.from_values(method="sart", attenuation=False)
    all_at_once = plan.changed(method="gauss-newton")
    width = finite_frequency_candidates(picked, plan)[0]["ray_width_m"]
    bent = {
        "SART": plan,
        "Gauss-Newton": all_at_once,
        "finite-frequency Gauss-Newton": all_at_once.changed(ray_width_m=width),
    }
    compared = {
        way: images.compared(images.made(settings).result, error_on) for way, settings in bent.items()
    }
    ideal_times = replace(picked, delta_tof_s=ideal(dataset), sigma_s=None, waveform=None)
    exact = reconstruct(ideal_times, all_at_once)
    exact_error = error_on(exact).of(exact)
    useful = exact_error < compared["Gauss-Newton"].error
    detail = ", ".join(
        f"{way} {figures.error:.1f} (straight {figures.baselines[STRAIGHT_RAYS]:.1f})"
        for way, figures in compared.items()
    )
    yardstick = "" if useful else ", worse than picks"
    detail += f", Gauss-Newton with ideal times {exact_error:.1f}{yardstick} (m/s)"
    for way, figures in compared.items():
        ratio = figures.error / figures.baselines[STRAIGHT_RAYS]
        yield figures.row(f"R4 {name}, {way}, bent over straight", ratio, 0.9, "<=", "", detail)
    if useful:
        ratio = compared["Gauss-Newton"].error / exact_error
        target = f"R4 {name}, Gauss-Newton, bent over ideal times"
        yield compared["Gauss-Newton"].row(target, ratio, 1.15, "<=", "", detail)
    default = images.default().result
    figures = images.compared(default, error_on)
    why = explain_candidates(default.trials)
    straight = {
        way: other.baselines[STRAIGHT_RAYS] for way, other in (compared | {"default": figures}).items()
    }
    for against, error in (
        ("straight SART", straight["SART"]),
        ("the best straight image, chosen by the truth", min(straight.values())),
    ):
        target = f"R4 {name}, default over {against}"
        yield figures.row(target, figures.error / error, 1.0, "<=", "", f"{detail}; {why}")


def measured(quick: bool) -> Iterable[Row]:
    """R7: the open-UST measurement by default; the truth serves only registration and error."""
    labels = "R7 open-UST, error", "R7 open-UST, time", "R7 open-UST, SART, bent over straight"
    if quick or not MEASURED.exists():
        why = "not in a quick run" if quick else "open-UST: the measurement is not there"
        yield Row(labels[0], None, 12.0, "<=", "m/s", why)
        yield Row(labels[1], None, 20.0, "<=", "s", why)
        yield Row(labels[2], None, 0.9, "<=", "", why)
        return
    dataset = read_dataset(MEASURED)
    assert dataset.truth is not None
    images = Images(dataset, reconstruct)
    result, seconds = images.default()
    truth = registered(result, dataset.truth, RADIUS_M)
    error_on = registered_error(truth, dataset.truth, RADIUS_M)
    compared = images.compared(result, error_on)
    x, y = (1e3 * shift for shift in truth.shift_m)
    detail = f"truth shifted by {x:.1f}, {y:.1f} mm; {explain_candidates(result.trials)}"
    yield compared.row(labels[0], truth.rms_mps, 12.0, "<=", "m/s", detail)
    yield compared.row(labels[1], seconds, 20.0, "<=", "s", "one process, trials included")
    bent = images.compared(
        images.made(Settings.from_values(method="sart", attenuation=False)).result, error_on
    )
    ratio = bent.error / bent.baselines[STRAIGHT_RAYS]
    detail = f"thin rays, m/s: bent {bent.error:.1f}, straight {bent.baselines[STRAIGHT_RAYS]:.1f}"
    yield bent.row(labels[2], ratio, 0.9, "<=", "", detail)
