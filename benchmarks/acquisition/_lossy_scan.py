"""A ring scan of the Table 6 phantom by waves that tissue absorbs."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from bentray_kernels.acquisition import Dataset, Truth, Waveform
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate
from bentray_service.cli.output.terminal import Step
from bentray_workers.simulation.plane import ring_radius
from bentray_workers.simulation.waves import (
    BEFORE,
    EDGE_NODES,
    ORDER,
    SAMPLES_A_PERIOD,
    WaveSimulationSettings,
)

from ._absorption import Absorbing, simulate_absorbed

# Loss grows as the frequency. Table 6 names none: at this one its gland, 50 Np/m, is as gland is, which
# loses 0.87 dB/cm at 1 MHz.
TABLE6_HZ = 5e6


def lossy_scan(asked: WaveSimulationSettings, progress: Step, *, proportional: bool) -> Dataset:
    """Traces of object and water, of another grid and order than any refinement's, without noise.

    Args:
        asked: the scan.
        progress: told of emissions.
        proportional: whether the loss grows as the frequency, as tissue's does; else all frequencies lose
            what the pulse's centre does, as in a refinement's model.
    """
    phantom, nodes = table6(asked.coupling_mps), asked.fine_nodes
    part = asked.frequency_hz / TABLE6_HZ
    speed, loss = phantom.speed(nodes, TABLE6_SIDE_M), part * phantom.attenuation(nodes, TABLE6_SIDE_M)
    grid = asked.spacing_m, asked.step_s
    water = Medium.of(np.full_like(speed, asked.coupling_mps), *grid, edge_nodes=EDGE_NODES)
    tissue: Medium | Absorbing
    if proportional:
        centre = asked.frequency_hz
        tissue = Absorbing.of(speed, *grid, attenuation=loss, frequency_hz=centre, edge_nodes=EDGE_NODES)
    else:
        tissue = Medium.of(speed, *grid, attenuation=loss, edge_nodes=EDGE_NODES)
    places = asked.elements_m() + 0.5 * asked.side_m
    late = asked.step_s * asked.frequency_hz * np.arange(asked.samples * asked.skip) - BEFORE
    pulse = np.exp(-((0.9 * late) ** 2)) * np.sin(2.0 * np.pi * late)
    traces = np.empty((2, asked.emissions, asked.elements, asked.samples), np.float32)

    def emission(k: int) -> None:
        emitter = places[asked.senders()[k]]
        for of_medium, medium in zip(traces, (tissue, water), strict=True):
            through = simulate_absorbed if isinstance(medium, Absorbing) else simulate
            of_medium[k] = through(medium, emitter, places, pulse, ORDER)[:, :: asked.skip]

    # The simulators let other threads run beside them.
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for k, _ in enumerate(pool.map(emission, range(asked.emissions))):
            progress(k, asked.emissions, "simulating waves with loss")
    apart = asked.side_m / (asked.nodes - 1)
    return Dataset(
        element_position_m=asked.elements_m(),
        tx=asked.senders(),
        rx=np.arange(asked.elements),
        water_speed_mps=asked.coupling_mps,
        waveform=Waveform(traces[0], traces[1]),
        roi=phantom.inside(asked.nodes, TABLE6_SIDE_M),
        truth=Truth(
            phantom.speed(asked.nodes, TABLE6_SIDE_M),
            (apart, apart),
            (-0.5 * asked.side_m, -0.5 * asked.side_m),
            part * phantom.attenuation(asked.nodes, TABLE6_SIDE_M),
        ),
        radius_m=ring_radius(asked.side_m, asked.nodes),
        center_frequency_hz=asked.frequency_hz,
        sampling_rate_hz=SAMPLES_A_PERIOD * asked.frequency_hz,
        t0_s=-BEFORE / asked.frequency_hz,
    )
