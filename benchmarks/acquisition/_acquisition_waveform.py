"""R10: full-waveform inversion against straight, bent and ideal rays on simulated wave scans."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from bentray_kernels.acquisition import Dataset, pick
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.model_selection.finite_frequency_candidates import finite_frequency_candidates
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.files.dataset import read_dataset
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.waves import WaveSimulationSettings

from ..shared._reconstruction_on_workers import Made, reconstruct_on_workers
from ._acquisition_picture import picture
from ._ideal_times import ideal

RESULTS = Path(__file__).parents[1] / "results"

# A scan simulated by another solver, not in the repository.
OTHERS = Path(__file__).parents[3] / "shared" / "data" / "ring_wave_a.h5"

# The fourth band doubles the time and reduces the error by 3 %.
WAVES = {"method": "waveform", "bands": 3}
RAYS: dict[str, dict[str, Any]] = {
    "straight": {"rays": "straight", "method": "sart"},
    "bent": {"rays": "curved", "method": "sart"},
    "bent, Gauss-Newton": {"rays": "curved", "method": "gauss-newton"},
}


def rows(quick: bool, progress: Step) -> Iterable[Row]:
    """R10 for each scan; the picture of all of them, unless quick."""
    shown: dict[str, tuple[Dataset, dict[str, Made]]] = {}
    for name, dataset in scans(quick, progress):
        images = made(name, dataset, 48 if quick else 128, progress)
        shown[name] = dataset, images
        yield from scan_rows(name, images)
    if not quick:
        (RESULTS / "acquisition_waveform.png").write_bytes(
            picture(shown, "wall-clock seconds of two workers")
        )
    reason = "stride: the package registry has none of it"
    yield Row("R10 over stride at equal time", None, 1.0, "<", "", reason)


def scans(quick: bool, progress: Step) -> Iterable[tuple[str, Dataset]]:
    """Names and scans, with traces."""
    small = WaveSimulationSettings(3e5, 0.05, 32, 16, nodes=64, snr=30.0)
    for asked in (small,) if quick else (WaveSimulationSettings(snr=30.0),):
        name = f"simulated {1e-3 * asked.frequency_hz:.0f} kHz"
        yield name, simulate(asked, lambda now, n=name: progress(now.done, now.total, n))
    if not quick and OTHERS.exists():
        yield "ring_wave_a 400 kHz", read_dataset(OTHERS)


def made(name: str, dataset: Dataset, nodes: int, progress: Step) -> dict[str, Made]:
    """The image of each method for one scan; rays share their picks, ``ideal`` has exact times."""
    picked = pick(dataset)
    found = {}
    _, bent_finite_frequency, _ = finite_frequency_candidates(picked, Settings(method="sart", nodes=nodes))
    for way, changes in {**RAYS, "bent, finite frequency": bent_finite_frequency}.items():
        found[way] = reconstruct_on_workers(
            replace(picked, waveform=None),
            Settings.of(nodes=nodes, **{"method": "sart", **changes}),
            progress,
        )
    found["ideal times"] = reconstruct_on_workers(
        replace(picked, delta_tof_s=ideal(dataset), sigma_s=None),
        Settings.of(nodes=nodes, **{"method": "sart", **RAYS["bent, Gauss-Newton"]}),
        progress,
    )
    found["waveform"] = reconstruct_on_workers(
        dataset, Settings.of(nodes=nodes, **{"method": "sart", **WAVES}), progress
    )
    return found


def scan_rows(name: str, images: dict[str, Made]) -> Iterable[Row]:
    """The rows of one scan."""
    detail = ", ".join(f"{way} {one.rms:.1f} m/s in {one.seconds:.0f} s" for way, one in images.items())
    straight, waves, best = (images[way].rms for way in ("straight", "waveform", "ideal times"))
    load = f"{os.getloadavg()[0]:.1f}"
    yield Row(f"R10 {name}, over straight", waves / straight, 0.65, "<=", "", detail)
    yield Row(f"R10 {name}, over straight, then", waves / straight, 0.5, "<=", "", detail)
    yield Row(f"R10 {name}, over ideal times", waves / best, 0.8, "<=", "", detail)
    took = images["waveform"].seconds
    yield Row(f"R10 {name}, time", took, 300.0, "<=", "s", f"two workers, load at the end {load}")
