"""R10 and W1: full-waveform inversion against rays, and against its own earlier time and error."""

import os
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from bentray_kernels.acquisition import Dataset, pick
from bentray_kernels.tomography import Reconstruction, Settings
from bentray_kernels.tomography.model_selection.finite_frequency_candidates import finite_frequency_candidates
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.simulation.waves import WaveSimulationSettings

from ..shared._baselines import Images
from ..shared._image_error import object_error
from ..shared._reconstruction_on_workers import Made, reconstruct_on_workers
from ..shared._recorded_scans import SMALL, other_scan, wave_scan
from ._acquisition_picture import picture
from ._ideal_times import ideal

# W1: errors before inversions were made faster (2026-11-23), m/s, when they took about 95 and 160 s.
BEFORE_MPS = {"simulated 500 kHz": 4.249, "ring_wave_a 400 kHz": 11.635}

RAYS: dict[str, dict[str, Any]] = {
    "straight": {"rays": "straight", "method": "sart"},
    "bent": {"rays": "curved", "method": "sart"},
    "bent, Gauss-Newton": {"rays": "curved", "method": "gauss-newton"},
}


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """R10 for each scan, with a picture of all of them."""
    shown: dict[str, tuple[Dataset, dict[str, Made]]] = {}
    for name, dataset in scans(context.quick, context.progress):
        scan = WaveScan(dataset, context)
        shown[name] = dataset, scan.made
        yield from scan.rows(name)
    context.save_picture(
        "acquisition_waveform.png", lambda: picture(shown, "wall-clock seconds of two workers")
    )
    reason = "stride: the package registry has none of it"
    yield Row("R10 over stride at equal time", None, 1.0, "<", "", reason)


def scans(quick: bool, progress: Step) -> Iterable[tuple[str, Dataset]]:
    """Names and scans, with traces."""
    yield wave_scan(replace(SMALL if quick else WaveSimulationSettings(), snr=30.0), progress)
    if not quick:
        yield from other_scan()


class WaveScan:
    """The images of one scan by workers: along rays, by default settings, and by FWI."""

    def __init__(self, dataset: Dataset, context: BenchmarkContext) -> None:
        """Reconstruct; rays share their picks, ``ideal times`` are exact.

        Args:
            dataset: with traces and truth.
            context: of the run.
        """
        picked = pick(dataset)
        width = finite_frequency_candidates(picked, Settings())[0]["ray_width_m"]
        wide = {"method": "gauss-newton", "ray_width_m": width}
        changes = {**RAYS, "bent, finite frequency": wide}
        self.made = {
            way: reconstruct_on_workers(
                replace(picked, waveform=None), Settings.from_values(**words), context
            )
            for way, words in changes.items()
        }
        self.made["ideal times"] = reconstruct_on_workers(
            replace(picked, delta_tof_s=ideal(dataset), sigma_s=None, waveform=None),
            Settings.from_values(**RAYS["bent, Gauss-Newton"]),
            context,
        )
        images = Images(dataset, lambda of, settings: self._on_workers(of, settings, context))
        images.default()
        self.made["waveform"] = reconstruct_on_workers(dataset, Settings(method="waveform"), context)
        self.compared = images.compared(self.made["waveform"].result, object_error(dataset))

    def _on_workers(self, dataset: Dataset, settings: Settings, context: BenchmarkContext) -> Reconstruction:
        made = reconstruct_on_workers(dataset, settings, context)
        if settings == Settings():
            self.made["default"] = made
        return made.result

    def rows(self, name: str) -> Iterable[Row]:
        """The rows of this scan; ideal times are a yardstick only where they are better than picks."""
        errors = {way: made.rms for way, made in self.made.items()}
        useful = errors["ideal times"] < errors["bent, Gauss-Newton"]
        detail = ", ".join(
            f"{way} {made.rms:.1f} m/s in {made.seconds:.0f} s" for way, made in self.made.items()
        )
        detail += "" if useful else "; ideal times are worse than picks by the same rays"
        load = f"{os.getloadavg()[0]:.1f}"
        for target, way, goal in (
            ("over straight SART", "straight", 0.65),
            ("over straight SART, then", "straight", 0.5),
            ("over ideal times", "ideal times", 0.8),
        ):
            if way == "straight" or useful:
                ratio = errors["waveform"] / errors[way]
                yield self.compared.row(f"R10 {name}, {target}", ratio, goal, "<=", "", detail)
        took = self.made["waveform"].seconds
        detail = f"two workers, load at the end {load}"
        yield self.compared.row(f"R10 {name}, time", took, 300.0, "<=", "s", detail)
        if name in BEFORE_MPS:
            yield self.compared.row(f"W1 {name}, time", took, 60.0, "<=", "s", detail)
            ratio = errors["waveform"] / BEFORE_MPS[name]
            yield self.compared.row(f"W1 {name}, error over that before", ratio, 1.05, "<=", "", detail)
