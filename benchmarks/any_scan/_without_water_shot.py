"""A1: a scan with its water shot and without, beside constants and straight rays."""

import os
from collections.abc import Iterable, Mapping
from typing import Any

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Settings
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step
from bentray_workers.simulation.waves import WaveSimulationSettings

from ..shared._baselines import Images
from ..shared._image_error import object_error
from ..shared._reconstruction_on_workers import Made, images_on_workers, reconstruct_on_workers
from ..shared._recorded_scans import other_scan, planted, wave_scan, without_water_shot
from ._images_beside_truth import images_beside_truth

# Largest error without the water shot, relative to that with it.
GOALS = {"auto": 1.05, "waveform": 1.15}

WAYS: dict[str, dict[str, Any]] = {
    "straight": {"method": "sart", "rays": "straight"},
    "bent": {"method": "sart"},
    "auto": {"method": "auto"},
    "waveform": {"method": "waveform"},
}
SHOWN = ("straight, none", "bent, none", "waveform, with", "waveform, none")


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """A1 for each scan, with a picture of all of them."""
    shown: dict[str, tuple[Dataset, dict[str, Made]]] = {}
    for name, dataset in scans(context.quick, context.progress):
        images = {}
        for way, changes in WAYS.items():
            settings = Settings.from_values(
                attenuation=False, **({"nodes": 48, "bands": 2} if context.quick else {}), **changes
            )
            for shot, scan in (("with", dataset), ("none", without_water_shot(dataset))):
                images[f"{way}, {shot}"] = reconstruct_on_workers(scan, settings, context)
        shown[name] = dataset, {way: images[way] for way in SHOWN}
        made = images_on_workers(without_water_shot(dataset), context)
        yield from scan_rows(name, dataset, images, made)
    title = "Images with the water shot, and with one estimated from the scan (none)"
    context.save_picture("any_scan_without_water_shot.png", lambda: images_beside_truth(title, shown))


def scans(quick: bool, progress: Step) -> Iterable[tuple[str, Dataset]]:
    """Names and scans, with traces of object and water."""
    asked = WaveSimulationSettings(3e5, 0.12, 128, 48, nodes=128, snr=30.0)
    if quick:
        asked = WaveSimulationSettings(3e5, 0.1, 64, 32, nodes=64, snr=30.0)
    name, made = wave_scan(asked, progress, "simulation")
    yield f"{name}, planted", planted(made, 1)
    if not quick:
        yield from other_scan()


def scan_rows(name: str, dataset: Dataset, images: Mapping[str, Made], made: Images) -> Iterable[Row]:
    """The rows of one scan."""
    detail = ", ".join(f"{way} {made.rms:.1f} in {made.seconds:.0f} s" for way, made in images.items())
    detail += f" (m/s; water shot with or none); load at the end {os.getloadavg()[0]:.1f}"
    for way, goal in GOALS.items():
        image = images[f"{way}, none"]
        ratio = image.rms / images[f"{way}, with"].rms
        target = f"A1 {name}, {way}: error without over with water shot"
        yield made.compared(image.result, object_error(dataset)).row(target, ratio, goal, "<=", "", detail)
