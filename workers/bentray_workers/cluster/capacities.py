"""What connected workers offer: memory and lanes; embedded ones try their OpenCL devices when first asked."""

from __future__ import annotations

import asyncio
import math
from dataclasses import dataclass
from typing import Any, Literal

from distributed import Client, LocalCluster

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import choose
from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.solver_choice import needs_device

from .connected import connected_workers
from .resources import OPENCL, RECONSTRUCTION

REAL = 8
MIB = 2**20

Lane = Literal["recon", "opencl"]

# What a worker holds once it is warm (266 MiB were measured), and to draw a picture beside its task.
WARM_BYTES = 384 * MIB

# Dask gives a worker no task while it holds more than this part of its limit.
USABLE = 0.8


@dataclass(frozen=True)
class Offer:
    """A worker that is connected.

    Attributes:
        memory_bytes: its limit; 0: none.
        lanes: what it offers, by the names in ``resources``.
    """

    memory_bytes: int
    lanes: tuple[str, ...]

    @property
    def task_bytes(self) -> float:
        """The largest task that it can hold."""
        return max(0.0, USABLE * self.memory_bytes - WARM_BYTES) if self.memory_bytes else math.inf


def lane_of(settings: Settings) -> Lane:
    """Where the calls of a reconstruction run: wave fronts on a device need a worker that has one."""
    return "opencl" if needs_device(settings) else "recon"


def offers_of(client: Client) -> tuple[Offer, ...]:
    """Of every worker that is connected now."""
    return tuple(offers_by_address(client).values())


def offers_by_address(client: Client) -> dict[str, Offer]:
    """The same by the worker's address."""
    return {
        address: Offer(
            int(worker.get("memory_limit") or 0),
            tuple(lane for lane, amount in worker.get("resources", {}).items() if amount > 0),
        )
        for address, worker in connected_workers(client).items()
    }


def prepared_offers(client: Client, settings: Settings) -> tuple[Offer, ...]:
    """As ``offers_of``, once embedded workers have tried their devices where the settings want one.

    A trial takes seconds in a process of its own, and few jobs want a device: at the start it would cost
    every service those seconds. Its outcome is kept on disk. Workers that joined have tried at their start,
    as they were told to, and are not asked.
    """
    if lane_of(settings) == "opencl" and isinstance(client.cluster, LocalCluster):
        client.run(offer_device)
    return offers_of(client)


def resources_for(client: Client, settings: Settings) -> dict[str, int]:
    """What each call of a reconstruction asks for.

    One that tracks wave fronts on a device takes the place of a reconstruction too, so that a process never
    holds two.

    Raises:
        InvalidInput: for a device where no connected worker offers one: its tasks would wait for ever.
    """
    if lane_of(settings) != "opencl":
        return RECONSTRUCTION
    if not any("opencl" in offer.lanes for offer in prepared_offers(client, settings)):
        raise InvalidInput(
            "eikonal", f"{settings.eikonal!r}, which no connected worker offers", "a method without a device"
        )
    return {**RECONSTRUCTION, **OPENCL}


async def offer_device(dask_worker: Any) -> bool:
    """On a worker: offer the OpenCL lane if a device passes its trial; whether it does."""
    if "opencl" in dask_worker.state.total_resources:
        return True
    # Not in the loop, which must go on telling the scheduler that the worker lives.
    found = await asyncio.get_running_loop().run_in_executor(None, _has_device)
    if found:
        await dask_worker.set_resources(**OPENCL)
    return found


def _has_device() -> bool:
    return choose().device is not None
