"""A phantom scan as a dataset, its emitters shared out over the workers or over this machine's cores."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from distributed import Client, as_completed
from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset, Truth
from bentray_kernels.acquisition.simulation import Ring, TravelTimeScan
from bentray_kernels.errors import InvalidInput
from bentray_kernels.phantoms import TABLE6_SIDE_M, table6
from bentray_kernels.tomography import Progress
from bentray_kernels.tomography.problem import MARGIN_NODES

from .lanes import RECONSTRUCTION

# Emitters a task: about a second of work on the default grid.
BATCH = 8


@dataclass(frozen=True)
class SimulationSettings:
    """A travel-time scan of the Table 6 phantom.

    Attributes:
        nodes: nodes along a side of the truth image, and of the reconstruction it is meant for.
        elements: of the ring, each emitter and receiver.
        coupling_mps: speed of the medium around the breast, m/s.
        refinement: how many times finer the travel times are made; at least 4.
        noise_s: standard deviation of Gaussian noise on the travel times, s.
        seed: of the noise.
    """

    nodes: int = 128
    elements: int = 256
    coupling_mps: float = 1500.0
    refinement: int = 4
    noise_s: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not 16 <= self.nodes <= 1024:
            raise InvalidInput("nodes", self.nodes, "16 to 1024")
        if not 0.0 <= self.noise_s < 1.0:
            raise InvalidInput("noise_s", self.noise_s, "seconds, 0 or more and less than 1")
        if not 3 <= self.elements <= 4096:
            raise InvalidInput("elements", self.elements, "3 to 4096")
        self.scan()

    def scan(self) -> TravelTimeScan:
        """The scan; the ring leaves the margin that a reconstruction of as many nodes leaves."""
        radius = 0.5 * TABLE6_SIDE_M * (1.0 - 2.0 * MARGIN_NODES / (self.nodes - 1))
        ring = Ring(self.elements, radius)
        return TravelTimeScan(table6(self.coupling_mps), ring, TABLE6_SIDE_M, self.nodes, self.refinement)


def simulate(
    client: Client | None, settings: SimulationSettings, on_progress: Callable[[Progress], None] | None = None
) -> Dataset:
    """Simulate a scan.

    Args:
        client: of a cluster; None uses the cores of this machine.
        settings: see ``SimulationSettings``.
        on_progress: called after each batch, with emitters done of all.

    Returns:
        A dataset with ``delta_tof_s``, ``truth`` and the object's outline as ``roi``.
    """
    scan = settings.scan()
    batches = np.array_split(np.arange(settings.elements), -(-settings.elements // BATCH))
    delta = np.empty((settings.elements, settings.elements))
    done = 0
    for batch, rows in _run(client, settings, batches):
        delta[batch] = rows
        done += len(batch)
        if on_progress is not None:
            on_progress(Progress(done, settings.elements))
    if settings.noise_s > 0.0:
        delta += np.random.default_rng(settings.seed).normal(0.0, settings.noise_s, delta.shape)
        np.fill_diagonal(delta, 0.0)
    spacing = scan.side_m / (scan.nodes - 1)
    phantom = scan.phantom
    return Dataset(
        element_position_m=scan.ring.positions(),
        tx=np.arange(settings.elements),
        rx=np.arange(settings.elements),
        water_speed_mps=settings.coupling_mps,
        delta_tof_s=delta,
        sigma_s=np.full(delta.shape, settings.noise_s) if settings.noise_s > 0.0 else None,
        roi=phantom.inside(scan.nodes, scan.side_m),
        truth=Truth(
            sound_speed_mps=phantom.speed(scan.nodes, scan.side_m),
            spacing_m=(spacing, spacing),
            origin_m=(-0.5 * scan.side_m, -0.5 * scan.side_m),
            attenuation_np_m=phantom.attenuation(scan.nodes, scan.side_m),
        ),
        radius_m=scan.ring.radius_m,
        picker=f"none: simulated travel times, factored fast marching, {scan.fine_nodes}² nodes",
        title=f"Table 6 phantom, coupling {settings.coupling_mps:g} m/s",
        source="made by bentray simulate",
        license="CC0-1.0",
    )


def _run(
    client: Client | None, settings: SimulationSettings, batches: list[NDArray[np.int64]]
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    if client is None:
        _fine_speed(settings)
        with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as pool:
            yield from zip(
                batches, pool.map(lambda batch: simulate_emitters(settings, batch), batches), strict=True
            )
        return
    futures = {
        client.submit(simulate_emitters, settings, batch, resources=RECONSTRUCTION, pure=False): batch
        for batch in batches
    }
    for future, rows in as_completed(futures, loop=client.loop, with_results=True):
        yield futures[future], rows


def simulate_emitters(settings: SimulationSettings, emitters: NDArray[np.int64]) -> NDArray[np.float64]:
    """Task: differential travel times of some emitters, (k, elements), s."""
    return settings.scan().delta_tof(emitters, _fine_speed(settings))


@lru_cache(maxsize=2)
def _fine_speed(settings: SimulationSettings) -> NDArray[np.float64]:
    return settings.scan().fine_speed()
