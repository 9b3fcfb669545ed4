"""Waves by k-Wave through the detailed breast without a water shot: straight rays, bent, auto, waveform."""

import os
from collections.abc import Iterable
from typing import Any

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.phantoms import DETAILED_SIDE_M, DetailedBreast
from bentray_service.cli.output.benchmark_context import BenchmarkContext
from bentray_service.cli.output.benchmark_row import Row
from bentray_service.cli.output.terminal import Step

from ..shared._image_error import object_error
from ..shared._reconstruction_on_workers import images_on_workers, reconstruct_in_ways
from ..shared._recorded_scans import planted, with_trace_noise, without_water_shot
from ..shared._ring_scan import RingScan
from ..waves._kwave_peer import Peer, installed
from ._images_beside_truth import images_beside_truth

WATER_MPS, CENTRE_HZ, SIDE_M, RING = 1480.0, 3e5, 0.12, 0.45
ELEMENTS, EMISSIONS, SNR = 128, 48, 30.0

# Its time step, in the longest of ours.
STEP = 0.25

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
    peers, _ = installed()
    if not peers or context.quick:
        return
    dataset = without_water_shot(planted(simulated(peers["k-Wave"], context.progress), 2))
    images = reconstruct_in_ways(dataset, WAYS, context)
    detail = ", ".join(f"{way} {made.rms:.1f} in {made.seconds:.0f} s" for way, made in images.items())
    detail += f" (m/s); load at the end {os.getloadavg()[0]:.1f}"
    made = images_on_workers(dataset, context)
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
    size = RingScan(
        SIDE_M, RING * SIDE_M, CENTRE_HZ, ELEMENTS, EMISSIONS, breast.speed_range(), WATER_MPS, peer, STEP
    )
    speed = breast.speed(size.nodes, DETAILED_SIDE_M)
    media = {"object": speed, "water": np.full_like(speed, WATER_MPS)}
    shots = size.recorded(media, progress)
    roi = breast.inside(size.nodes, DETAILED_SIDE_M)
    return with_trace_noise(size.dataset(shots["object"], shots["water"], speed, roi), SNR, seed=3)
