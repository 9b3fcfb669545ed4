"""A2: travel times through a detailed breast by the default settings, beside former ones and constants."""

import os
from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography.model_selection.selection import explain_candidates
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.simulation_run import simulate

from ..shared._image_error import object_error
from ..shared._reconstruction_on_workers import images_on_workers, reconstruct_in_ways
from ._images_beside_truth import images_beside_truth

# The target is 27 m/s where the truth differs from itself, blurred by this, m, by 19 m/s.
BLUR_M = 1e-3
ERROR_MPS, SECONDS = 27.0, 20.0
GOAL = ERROR_MPS / 19.0

WAYS: dict[str, dict[str, Any]] = {
    "straight": {"method": "sart", "rays": "straight", "nodes": 128},
    "former default": {"method": "sart", "nodes": 128},
    "default": {},
}

# Standard deviations of the noise, s.
NOISES_S = (0.0, 2e-8)


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """A2 without noise and with some, with a picture of the first."""
    for noise in NOISES_S[: 1 if context.quick else None]:
        asked = SimulationSettings(
            "detailed",
            nodes=64 if context.quick else 256,
            elements=64 if context.quick else 256,
            coupling_mps=1480.0,
            noise_s=noise,
        )
        dataset = simulate(asked, lambda now: context.progress(now.done, now.total, "simulation"))
        images = reconstruct_in_ways(dataset, WAYS, context)
        default, blurred = images["default"], blurred_error(dataset)
        compared = images_on_workers(dataset, context).compared(default.result, object_error(dataset))
        detail = f"truth blurred by 1 mm {blurred:.1f}, "
        detail += ", ".join(f"{way} {made.rms:.1f} in {made.seconds:.1f} s" for way, made in images.items())
        nodes = default.result.settings.nodes
        detail += f" (m/s); {nodes} nodes; {explain_candidates(default.result.trials)}"
        detail += f"; load at the end {os.getloadavg()[0]:.1f}"
        name = f"A2 detailed breast, {asked.elements} elements, noise {1e9 * noise:.0f} ns"
        yield compared.row(f"{name}: error", default.rms, ERROR_MPS, "<=", "m/s", detail)
        ratio = default.rms / blurred
        yield compared.row(f"{name}: error over that of the blurred truth", ratio, GOAL, "<=", "", detail)
        target = f"{name}: time on {os.cpu_count()} cores"
        yield compared.row(target, default.seconds, SECONDS, "<=", "s", detail)
        if not noise:
            title = f"Exact times, {asked.elements} elements"
            drawn = partial(images_beside_truth, title, {"detailed breast": (dataset, images)})
            context.save_picture("any_scan_default_settings.png", drawn)


def blurred_error(dataset: Dataset) -> float:
    """Rms difference of the truth from itself blurred by ``BLUR_M``, in the region of interest, m/s."""
    truth, roi = dataset.truth, dataset.roi
    assert truth is not None
    assert roi is not None
    speed = truth.sound_speed_mps
    difference = gaussian_filter(speed, BLUR_M / truth.spacing_m[0]) - speed
    return float(np.sqrt((difference[roi] ** 2).mean()))
