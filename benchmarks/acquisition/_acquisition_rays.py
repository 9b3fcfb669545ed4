"""R4 and R7: finite-frequency rays against thin and straight ones on the same picks; choices of auto."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from bentray_kernels.acquisition import Dataset, Waveform, pick
from bentray_kernels.tomography import Reconstruction, Settings, reconstruct
from bentray_kernels.tomography.model_selection.finite_frequency_candidates import finite_frequency_candidates
from bentray_kernels.tomography.model_selection.selection import explain_trials
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.files.dataset import read_dataset
from bentray_workers.images.truth_comparison import compare
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.waves import WaveSimulationSettings

from ._ideal_times import ideal
from ._registration import registered

# Scans that are not in the repository.
DATA = Path(__file__).parents[3] / "shared" / "data"
OTHERS, MEASURED = DATA / "ring_wave_a.h5", DATA / "openust_measured.h5"

# Phantom of Table 6. A scan of f Hz on a side of s m is equivalent to one of 2·f on s/2, so that sides are
# chosen by the cost of the simulation: 40, 78 and 91 wavelengths across the ring.
SCANS = (
    WaveSimulationSettings(5e5, 0.12, 128, 64),
    WaveSimulationSettings(1e6, 0.12, 128, 32),
    WaveSimulationSettings(2e6, 0.07, 128, 16),
)
QUICK = WaveSimulationSettings(3e5, 0.05, 32, 16, nodes=64)
SNRS = (np.inf, 30.0, 10.0)

# Radius of the region in which the authors of the measurement evaluate their error, m.
RADIUS_M = 0.0675


def rows(quick: bool, progress: Step) -> Iterable[Row]:
    """R4 for each scan and noise; R7, unless quick."""
    for asked in (QUICK,) if quick else SCANS:
        name = f"simulated {1e-3 * asked.frequency_hz:.0f} kHz, {1e3 * asked.side_m:.0f} mm"
        clean = simulate(asked, lambda now, n=name: progress(now.done, now.total, n))
        for snr in (30.0,) if quick else SNRS:
            detail = name + (f", SNR {snr:g}" if snr < np.inf else ", no noise")
            yield from scan_rows(detail, noisy(clean, snr), 48 if quick else 128)
    if not quick and OTHERS.exists():
        yield from scan_rows("ring_wave_a 400 kHz", read_dataset(OTHERS), 128)
    yield from measured(quick)


def noisy(dataset: Dataset, snr: float) -> Dataset:
    """Add white noise to the traces of object and water; ``snr`` as in ``WaveSimulationSettings``."""
    traces = dataset.waveform
    assert traces is not None
    assert traces.water is not None
    random = np.random.default_rng(0)
    sigma = float(np.median(np.abs(traces.water).max(axis=-1))) / snr
    return replace(
        dataset,
        waveform=Waveform(
            *(
                (part + sigma * random.standard_normal(part.shape)).astype(np.float32)
                for part in (traces.object, traces.water)
            )
        ),
    )


def scan_rows(name: str, dataset: Dataset, nodes: int) -> Iterable[Row]:
    """The rows of one scan."""
    picked = replace(pick(dataset), waveform=None)
    plan = Settings.of(method="sart", nodes=nodes, attenuation=False)
    all_at_once = {"method": "gauss-newton"}
    straight_finite_frequency, bent_finite_frequency, _ = finite_frequency_candidates(picked, plan)
    ways: Mapping[str, Mapping[str, Any]] = {
        "straight": {"rays": "straight"},
        "straight, Gauss-Newton": {"rays": "straight", **all_at_once},
        "straight, finite frequency": straight_finite_frequency,
        "bent": {},
        "bent, Gauss-Newton": all_at_once,
        "bent, finite frequency": bent_finite_frequency,
    }
    found = {
        way: error(reconstruct(picked, plan.changed(**changes)), dataset) for way, changes in ways.items()
    }
    # It chooses by times; the traces are used to estimate the benefit of FWI.
    advised = reconstruct(replace(picked, waveform=dataset.waveform), replace(plan, method="auto"))
    found["auto"] = error(advised, dataset)
    exact = replace(picked, delta_tof_s=ideal(dataset), sigma_s=None)
    found["ideal times"] = error(reconstruct(exact, plan.changed(**all_at_once)), dataset)
    detail = ", ".join(f"{way} {rms:.1f} m/s" for way, rms in found.items())
    bent = min(found[way] for way in ways if way.startswith("bent"))
    best_straight = min(found[way] for way in ways if way.startswith("straight"))
    yield Row(f"R4 {name}, bent over straight", bent / found["straight"], 0.9, "<=", "", detail)
    yield Row(f"R4 {name}, bent over ideal times", bent / found["ideal times"], 1.15, "<=", "", detail)
    why = explain_trials(advised.trials)
    yield Row(f"R4 {name}, auto over straight", found["auto"] / found["straight"], 1.0, "<=", "", why)
    yield Row(f"R4 {name}, auto over the best straight", found["auto"] / best_straight, 1.0, "<=", "", detail)


def error(result: Reconstruction, dataset: Dataset) -> float:
    """m/s rms over the object."""
    assert dataset.truth is not None
    return compare(result, dataset.truth, dataset.roi).rmse_mps


def measured(quick: bool) -> Iterable[Row]:
    """R7: the open-UST measurement by ``auto``; the truth is used only for registration and error."""
    labels = "R7 open-UST, error", "R7 open-UST, time"
    if quick or not MEASURED.exists():
        why = "not in a quick run" if quick else "open-UST: the measurement is not there"
        yield Row(labels[0], None, 12.0, "<=", "m/s", why)
        yield Row(labels[1], None, 20.0, "<=", "s", why)
        return
    dataset = read_dataset(MEASURED)
    assert dataset.truth is not None
    begun = time.perf_counter()
    result = reconstruct(dataset, Settings(method="auto"))
    seconds = time.perf_counter() - begun
    found = registered(result, dataset.truth, RADIUS_M)
    x, y = (1e3 * shift for shift in found.shift_m)
    detail = f"truth shifted by {x:.1f}, {y:.1f} mm; {explain_trials(result.trials)}"
    yield Row(labels[0], found.rms_mps, 12.0, "<=", "m/s", detail)
    yield Row(labels[1], seconds, 20.0, "<=", "s", "one process, trials included")
