"""Scans of breasts of four densities in water, with noise; no setting was chosen with them."""

from collections.abc import Iterator

import numpy as np

from bentray_kernels.acquisition import Dataset
from bentray_kernels.phantoms import DENSITIES, DETAILED_SIDE_M, DetailedBreast
from bentray_service.cli.output.benchmark_context import BenchmarkContext

from ..shared._recorded_scans import with_trace_noise
from ..shared._ring_scan import RingScan
from ..waves._kwave_peer import Peer

WATER_MPS, SNR = 1500.0, 30.0

# Half the size of a breast, so that minutes suffice: 300 kHz there are 150 kHz in a breast of full size.
SIDE_M, RADIUS_M, CENTRE_HZ, ELEMENTS, EMISSIONS = 0.12, 0.054, 3e5, 128, 48
QUICK = (1e5, 64, 16)


def density_scans(peer: Peer | None, context: BenchmarkContext) -> Iterator[tuple[str, Dataset]]:
    """Each density with its scan; in a quick run one of them.

    Args:
        peer: k-Wave, or None: our simulator.
        context: with the progress.
    """
    centre, elements, emissions = QUICK if context.quick else (CENTRE_HZ, ELEMENTS, EMISSIONS)
    names = list(DENSITIES)[: 1 if context.quick else None]
    breasts = {name: DetailedBreast(WATER_MPS, anatomy=DENSITIES[name]) for name in names}
    lowest, highest = zip(*(breast.speed_range() for breast in breasts.values()), strict=True)
    size = RingScan(
        SIDE_M, RADIUS_M, centre, elements, emissions, (min(lowest), max(highest)), WATER_MPS, peer
    )
    # The phantom of full size on a grid of half of it.
    speeds = {name: breast.speed(size.nodes, DETAILED_SIDE_M) for name, breast in breasts.items()}
    still = np.full((size.nodes, size.nodes), WATER_MPS)
    water = size.recorded({"water": still}, context.progress)["water"]
    for seed, (name, breast) in enumerate(breasts.items()):
        traces = size.recorded({name: speeds[name]}, context.progress)[name]
        inside = breast.inside(size.nodes, DETAILED_SIDE_M)
        yield name, with_trace_noise(size.dataset(traces, water, speeds[name], inside), SNR, seed=20 + seed)
