"""Peak memory of the calls of a refinement by waveforms, each in a process; see ``ray_task_memory``."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from benchmarks.shared._peak_memory import peak
from numpy.typing import NDArray
from tests.workers.reconstruction.ray_task_memory import held

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.acquisition.emissions import Emissions
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.scan import MemorySource
from bentray_kernels.tomography.waveform import refinement_graph as waves
from bentray_kernels.tomography.waveform.automatic_settings import scale_of, wave_settings
from bentray_kernels.tomography.waveform.band_inversion import Evaluation
from bentray_kernels.tomography.waveform.inversion_state import Image
from bentray_kernels.tomography.waveform.validation import validate_image, validation_settings
from bentray_kernels.tomography.waveform.wave_scan import WaveScan
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate

CENTRE_HZ, RATE_HZ, RADIUS_M, WATER = 2.5e5, 2.5e6, 0.05, 1500.0
FINER, SPACING_M = 4, 1e-3


def scan(elements: int, samples: int) -> Dataset:
    """Water, seen by a ring: one shot, turned to every emitter."""
    ring = Ring(elements, RADIUS_M).positions()
    half = int(RADIUS_M / SPACING_M) + 6
    step = 1.0 / (RATE_HZ * FINER)
    late = (step * np.arange(samples * FINER) - 8e-6) * CENTRE_HZ
    wavelet = np.exp(-((0.9 * late) ** 2)) * np.sin(2.0 * np.pi * late)
    medium = Medium.from_speed(np.full((2 * half + 1, 2 * half + 1), WATER), SPACING_M, step, edge_nodes=40)
    positions = ring + SPACING_M * half
    shot = simulate(medium, positions[0], positions, wavelet)[:, ::FINER].astype(np.float32)
    every = np.arange(elements)

    def read() -> Emissions:
        """As from a file with all emissions in one chunk."""

        @lru_cache(maxsize=1)
        def block() -> NDArray[np.float32]:
            return np.stack([np.roll(shot, k, axis=0) for k in every])

        return Emissions.from_reader(lambda e: block()[e], (elements, elements, samples), shot.dtype)

    return Dataset(
        ring,
        every,
        every,
        WATER,
        waveform=Waveform(read(), read()),  # type: ignore[arg-type]
        center_frequency_hz=CENTRE_HZ,
        sampling_rate_hz=RATE_HZ,
    )


def bytes_of(dataset: Dataset, settings: Settings) -> dict[str, int]:
    """Of each call in the last band; of a step with all pairs of changes that it may have."""
    samples = dataset.waveform.object.shape[-1]
    plan = wave_settings(scale_of(dataset, settings, samples, 1), settings)
    number = len(plan.bands) - 1
    start = Image(np.full((32, 32), WATER), 2.2 * RADIUS_M / 31, (-1.1 * RADIUS_M, -1.1 * RADIUS_M))
    nothing = peak(lambda: None)
    fresh = WaveScan(MemorySource(dataset), plan)
    # Measured first, for what was read once stays.
    found = {"start_band": peak(lambda: waves.start_band(fresh, number, start)) - nothing}
    judged = WaveScan(MemorySource(dataset), validation_settings(plan))
    found["validate_image"] = peak(lambda: validate_image(judged, start)) - nothing
    here = WaveScan(MemorySource(dataset), plan)
    entered = waves.start_band(here, number, start)
    assert entered is not None
    # As ``held`` counts the problem, and the traces that it holds.
    problem = here.problem(number)
    nothing = peak(lambda: None)
    image, model = entered.state.image, entered.model

    def look() -> waves.EmitterMisfit:
        return waves.evaluate_emitter(here, number, model, 0)

    kept = held(problem, list(problem.traces.values()))
    found["evaluate_emitter"] = kept + held(model) + peak(look) - nothing
    looks = [look()] * entered.emitters
    random = np.random.default_rng(0)
    pairs = random.normal(size=(plan.memory, *image.shape))
    state = replace(
        entered.state,
        image=image + 1.0,
        illumination=np.ones_like(image),
        steps=pairs,
        changes=pairs.copy(),
        history=(Evaluation(1.0, 1.0, accepted=True),),
    )
    copies = 2 * len(looks) * image.nbytes
    found["update_image"] = (
        kept + held(state) + copies + peak(lambda: waves.update_image(here, number, state, looks)) - nothing
    )
    return found


def main(settings: dict[str, Any], elements: int, samples: int) -> dict[str, int]:
    # Loading compiled code takes memory too, here and not in the forks.
    bytes_of(scan(16, 260), Settings.from_values(method="waveform", bands=2))
    asked = Settings.from_values(method="waveform", **settings)
    return bytes_of(scan(elements, samples), asked)
