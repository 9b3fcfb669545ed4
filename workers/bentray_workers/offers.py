"""What connected workers offer: memory and lanes; embedded ones try their OpenCL devices when first asked."""

from __future__ import annotations

import asyncio
from typing import Any

from distributed import Client, LocalCluster

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import choose
from bentray_kernels.tomography.settings import Settings

from .connected import connected_workers
from .lanes import OPENCL, RECONSTRUCTION
from .planning import Offer, lane_of


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
