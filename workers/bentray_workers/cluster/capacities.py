"""Capacities of connected workers: memory and resources; embedded workers test OpenCL devices on demand."""

import asyncio
import math
from dataclasses import dataclass
from typing import Any, Literal

from distributed import Client, LocalCluster

from bentray_kernels.errors import InvalidInput
from bentray_kernels.opencl import select_device
from bentray_kernels.tomography.settings import Settings
from bentray_kernels.tomography.solver_choice import needs_device, tracks_on_device

from .connected import connected_workers
from .resources import OPENCL, OPENCL_MIB, RECONSTRUCTION

REAL = 8
MIB = 2**20

Lane = Literal["recon", "opencl"]

# Memory of a warm worker (380 MiB were measured), and of a picture drawn beside its task.
WARM_BYTES = 384 * MIB

# Dask pauses a worker that uses more than this part of its memory limit.
USABLE = 0.8


@dataclass(frozen=True)
class WorkerCapacity:
    """Capacity of a connected worker.

    Attributes:
        memory_bytes: its limit; 0: none.
        resources: by the names in ``cluster.resources``.
        device_bytes: memory of its OpenCL device; 0: unknown, or no device.
    """

    memory_bytes: int
    resources: tuple[str, ...]
    device_bytes: int = 0

    @property
    def task_bytes(self) -> float:
        """Memory of the largest task that it can run."""
        return max(0.0, USABLE * self.memory_bytes - WARM_BYTES) if self.memory_bytes else math.inf


def resource_of(settings: Settings) -> Lane:
    """The resource that tasks of a reconstruction need: OpenCL where wave fronts or waves need a device."""
    return "opencl" if needs_device(settings) else "recon"


def without_device(settings: Settings) -> InvalidInput:
    """The error of settings that need a device that no connected worker has."""
    if tracks_on_device(settings):
        given, accepted = f"{settings.eikonal!r}, which no connected worker has", "a method without a device"
        return InvalidInput("eikonal", given, accepted)
    return InvalidInput("device", f"{settings.device!r}, which no connected worker has", "auto or cpu")


def capacities_of(client: Client) -> tuple[WorkerCapacity, ...]:
    """Capacities of all workers that are connected now."""
    return tuple(capacities_by_address(client).values())


def capacities_by_address(client: Client) -> dict[str, WorkerCapacity]:
    """Capacities of workers by their address."""
    return {
        address: WorkerCapacity(
            int(worker.get("memory_limit") or 0),
            tuple(
                name
                for name, amount in worker.get("resources", {}).items()
                if amount > 0 and name != OPENCL_MIB
            ),
            int(worker.get("resources", {}).get(OPENCL_MIB, 0)) * MIB,
        )
        for address, worker in connected_workers(client).items()
    }


def probed_capacities(client: Client, settings: Settings) -> tuple[WorkerCapacity, ...]:
    """Like ``capacities_of``, after embedded workers have tested their devices where the settings need one.

    The test takes seconds in a separate process and few jobs need a device, so it is not made at the start
    of every service. Its result is stored on disk. Workers that joined the cluster test at their start.
    """
    if resource_of(settings) == "opencl" and isinstance(client.cluster, LocalCluster):
        client.run(probe_device)
    return capacities_of(client)


def resources_for(client: Client, settings: Settings) -> dict[str, int]:
    """The resources that each task of a reconstruction needs.

    A task on a device uses the reconstruction resource too, so that a process never runs two of them.

    Raises:
        InvalidInput: for a device that no connected worker has: its tasks would wait for ever.
    """
    if resource_of(settings) != "opencl":
        return RECONSTRUCTION
    if not any("opencl" in capacity.resources for capacity in probed_capacities(client, settings)):
        raise without_device(settings)
    return {**RECONSTRUCTION, **OPENCL}


async def probe_device(dask_worker: Any) -> bool:
    """On a worker: add the OpenCL resource if a device passes its self-test; returns whether it does."""
    if "opencl" in dask_worker.state.total_resources:
        return True
    # Not in the event loop, which sends heartbeats to the scheduler.
    passed = await asyncio.get_running_loop().run_in_executor(None, _has_device)
    if passed:
        await dask_worker.set_resources(**device_resources())
    return passed


def device_resources() -> dict[str, float]:
    """The resources of a worker with the chosen device."""
    device = select_device().device
    return {**OPENCL, **({} if device is None else {OPENCL_MIB: device.memory_bytes // MIB})}


def _has_device() -> bool:
    return select_device().device is not None
