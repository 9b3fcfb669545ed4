"""Waves by k-Wave through the detailed breast without a water shot: straight rays, bent, auto, waveform."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from typing import Any

import numpy as np

from bentray_kernels.acquisition import Dataset, Truth, Waveform
from bentray_kernels.phantoms import DETAILED_SIDE_M, DetailedBreast
from bentray_kernels.tomography import Settings
from bentray_kernels.wave.stencil import longest_step
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step

from ..shared._baselines import Images
from ..shared._image_error import object_error
from ..shared._reconstruction_on_workers import reconstruct_on_workers
from ..shared._trace_noise import with_trace_noise
from ..waves._kwave_peer import Peer, installed
from ._images_beside_truth import images_beside_truth
from ._planted_scan import planted, without_water_shot

WATER_MPS, CENTRE_HZ, SIDE_M, RING = 1480.0, 3e5, 0.12, 0.45
ELEMENTS, EMISSIONS, SNR = 128, 48, 30.0

# Nodes in the shortest wave of the pulse, in the slowest tissue: its derivatives in space are exact for
# waves of two. Its time step is that part of the longest of ours.
NODES_A_WAVE, HIGHEST, STEP = 4.0, 1.54, 0.25
SAMPLES_A_PERIOD = 8
BEFORE, AFTER = 3.5, 12.0

WAYS: dict[str, dict[str, Any]] = {
    "straight": {"method": "sart", "rays": "straight"},
    "bent": {"method": "sart", "rays": "curved"},
    "auto": {"method": "auto"},
    "waveform": {"method": "waveform"},
}

# Errors relative to those of straight rays: goals of R4 and of R10.
GOALS = {"auto": 0.9, "waveform": 0.5}


def rows(context: BenchmarkContext) -> Iterable[Row]:
    """The rows of a scan by k-Wave, where it is installed."""
    found, _ = installed()
    if not found or context.quick:
        return
    dataset = without_water_shot(planted(simulated(found["k-Wave"], context.progress), 2))
    images = {
        way: reconstruct_on_workers(dataset, Settings.of(attenuation=False, **changes), context)
        for way, changes in WAYS.items()
    }
    detail = ", ".join(f"{way} {one.rms:.1f} in {one.seconds:.0f} s" for way, one in images.items())
    detail += f" (m/s); load at the end {os.getloadavg()[0]:.1f}"
    made = Images(
        dataset,
        lambda scan, settings: reconstruct_on_workers(scan, settings, context).result,
        Settings.of(attenuation=False),
    )
    for way, goal in GOALS.items():
        ratio = images[way].rms / images["straight"].rms
        target = f"k-Wave scan without water shot, {way}: error over straight rays"
        compared = made.compared(images[way].result, object_error(dataset))
        yield compared.row(target, ratio, goal, "<=", "", detail)
    shown = {"detailed breast": (dataset, images)}
    context.save_picture(
        "any_scan_kwave.png", lambda: images_beside_truth("Waves by k-Wave, no water shot", shown)
    )


def simulated(peer: Peer, progress: Step) -> Dataset:
    """Traces of a ring whose elements lie on nodes, with noise, through the breast and through water.

    Args:
        peer: k-Wave.
        progress: of the emissions.
    """
    breast = DetailedBreast(WATER_MPS)
    low, high = breast.speed_range()
    nodes = math.ceil(SIDE_M * NODES_A_WAVE * HIGHEST * CENTRE_HZ / low) + 1
    spacing = SIDE_M / (nodes - 1)
    turn = 2.0 * np.pi * np.arange(ELEMENTS) / ELEMENTS
    place = RING * SIDE_M * np.column_stack((np.cos(turn), np.sin(turn)))
    ring = np.rint((place + 0.5 * SIDE_M) / spacing).astype(int)
    rate = SAMPLES_A_PERIOD * CENTRE_HZ
    skip = math.ceil(1.0 / (rate * STEP * longest_step(high, spacing)))
    step = 1.0 / (rate * skip)
    samples = round((2.0 * RING * SIDE_M / low + (BEFORE + AFTER) / CENTRE_HZ) * rate)
    late = (step * np.arange(samples * skip)) * CENTRE_HZ - BEFORE
    pulse = np.exp(-((0.9 * late) ** 2)) * np.sin(2.0 * np.pi * late)
    tx = np.arange(EMISSIONS) * ELEMENTS // EMISSIONS
    media = {"object": breast.speed(nodes, DETAILED_SIDE_M), "water": np.full((nodes, nodes), WATER_MPS)}
    recorded = {}
    for name, speed in media.items():
        shots = np.zeros((EMISSIONS, ELEMENTS, samples))
        for number, element in enumerate(tx):
            progress(number, EMISSIONS, f"k-Wave, {name}")
            others = np.delete(np.arange(ELEMENTS), element)
            traces = peer(speed, spacing, step, ring[element], ring[others], pulse)
            shots[number, others] = traces[:, ::skip]
        recorded[name] = shots
    corner = -0.5 * SIDE_M
    dataset = Dataset(
        element_position_m=ring * spacing + corner,
        tx=tx,
        rx=np.arange(ELEMENTS),
        water_speed_mps=WATER_MPS,
        waveform=Waveform(recorded["object"], recorded["water"]),
        roi=breast.inside(nodes, DETAILED_SIDE_M),
        truth=Truth(media["object"], (spacing, spacing), (corner, corner)),
        radius_m=RING * SIDE_M,
        center_frequency_hz=CENTRE_HZ,
        sampling_rate_hz=rate,
        t0_s=-BEFORE / CENTRE_HZ,
        source="made by k-Wave",
    )
    return with_trace_noise(dataset, SNR, seed=3)
