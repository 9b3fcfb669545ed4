"""Simulated ring scan of a breast phantom (Tables 6 and 7) with absorption."""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate
from bentray_service.cli.output.terminal import Step
from bentray_workers.simulation.waves import (
    BEFORE,
    EDGE_NODES,
    ORDER,
    WaveSimulationSettings,
    scan_of,
)

from ._absorption import Absorbing, simulate_absorbed

# Loss is proportional to the frequency. Table 6 names none: at this one its gland, 50 Np/m, has the loss of
# real gland, 0.87 dB/cm at 1 MHz.
TABLE6_HZ = 5e6


def lossy_scan(
    settings: WaveSimulationSettings, progress: Step, *, proportional: bool, reference_hz: float = TABLE6_HZ
) -> Dataset:
    """Noise-free traces of object and water, with another grid and order than any inversion.

    Args:
        settings: the scan.
        progress: called for emissions.
        proportional: whether the loss is proportional to the frequency, as in tissue; else it is constant, as
            in the model of the inversion.
        reference_hz: frequency at which the phantom has the loss of its table.
    """
    phantom, nodes, side = settings.phantom, settings.fine_nodes, settings.phantom_side_m
    ratio = settings.frequency_hz / reference_hz
    speed, loss = settings.speed(), ratio * phantom.attenuation(nodes, side)
    grid, made = (settings.spacing_m, settings.step_s), {"edge_nodes": EDGE_NODES, "order": ORDER}
    water = Medium.from_speed(np.full_like(speed, settings.coupling_mps), *grid, **made)
    tissue: Medium | Absorbing
    if proportional:
        centre = settings.frequency_hz
        tissue = Absorbing.from_speed(
            speed, *grid, attenuation=loss, frequency_hz=centre, edge_nodes=EDGE_NODES
        )
    else:
        tissue = Medium.from_speed(speed, *grid, attenuation=loss, **made)
    positions = settings.elements_m() + 0.5 * settings.side_m
    late = settings.step_s * settings.frequency_hz * np.arange(settings.samples * settings.skip) - BEFORE
    pulse = np.exp(-((0.9 * late) ** 2)) * np.sin(2.0 * np.pi * late)
    traces = np.empty((2, settings.emissions, settings.elements, settings.samples), np.float32)

    def emission(k: int) -> None:
        emitter = positions[settings.senders()[k]]
        for of_medium, medium in zip(traces, (tissue, water), strict=True):
            if isinstance(medium, Absorbing):
                recorded = simulate_absorbed(medium, emitter, positions, pulse, ORDER)
            else:
                recorded = simulate(medium, emitter, positions, pulse)
            of_medium[k] = recorded[:, :: settings.skip]

    # The simulators release the GIL.
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for k, _ in enumerate(pool.map(emission, range(settings.emissions))):
            progress(k, settings.emissions, "simulating waves with loss")
    scan = scan_of(settings, Waveform(traces[0], traces[1]))
    assert scan.truth is not None
    losses = ratio * phantom.attenuation(settings.nodes, side)
    return replace(scan, truth=replace(scan.truth, attenuation_np_m=losses), source="", title="")
