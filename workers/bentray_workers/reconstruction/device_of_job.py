"""The device of a job with ``device: auto``: decided on the workers once, and kept by a resumed job."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

from distributed import Client, LocalCluster

from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.device_choice import ScanSize, device_work, needs_decision, with_device
from bentray_kernels.tomography.reconstruction import device_request

from ..cluster.capacities import capacities_by_address, capacities_of, resources_for
from ..files.atomic import write_bytes
from ..files.dataset.scan import read_scan
from ..files.dataset.traces import trace_samples

# In the folder of the job.
DECISION = "device"


def settled(client: Client | None, folder: Path, scan: Path, settings: Settings) -> Settings:
    """The settings with the device that all tasks of the job use, so that its bits are of one device.

    Args:
        client: of a cluster; None: threads of this process.
        folder: of the job.
        scan: a file in the upload format.
        settings: of the job.

    Raises:
        InvalidInput: for a device that is requested, and of which there is none.
    """
    # Workers of a cluster are asked for a device that is requested when the tasks are placed.
    if client is not None and (settings.device != "auto" or not _may_decide(client, settings)):
        return settings
    if client is None and not needs_decision(settings):
        return settings
    dataset = read_scan(scan)
    if dataset.delta_tof_s is None and dataset.center_frequency_hz is None:
        return settings
    size, sized = device_request(dataset, settings, trace_samples(scan))
    if device_work(size, sized) is None:
        return settings
    file = folder / DECISION
    if settings.device == "auto" and (before := _read(file)):
        chosen = settings.changed(device=before)
        if client is None or _offered(client, chosen):
            return chosen
    decided = with_device(size, sized) if client is None else _on_workers(client, size, sized)
    write_bytes(file, decided.device.encode())
    return settings.changed(device=decided.device)


def _may_decide(client: Client, settings: Settings) -> bool:
    """Whether a worker may have a device for ``auto``; embedded ones have those of this machine."""
    if isinstance(client.cluster, LocalCluster):
        return needs_decision(settings)
    offered = any("opencl" in worker.resources for worker in capacities_of(client))
    return offered and (settings.method != "gauss-newton" or settings.reflection.enabled)


def _read(file: Path) -> str:
    try:
        text = file.read_text()
    except OSError:
        return ""
    return text if text in ("auto", "opencl") else ""


def _offered(client: Client, settings: Settings) -> bool:
    try:
        resources_for(client, settings)
    except InvalidInput:
        return False
    return True


def _on_workers(client: Client, scan: ScanSize, settings: Settings) -> Settings:
    """On those that have a device; embedded ones have not tested theirs yet."""
    local = isinstance(client.cluster, LocalCluster)
    able = [
        address
        for address, worker in capacities_by_address(client).items()
        if local or "opencl" in worker.resources
    ]
    if not able:
        return settings
    answers = client.run(device_here, scan, settings, workers=able[:1] if local else able)
    chosen = settings.changed(device="opencl")
    wanted = all(answer == "opencl" for answer in answers.values())
    return chosen if wanted and _offered(client, chosen) else settings


async def device_here(scan: ScanSize, settings: Settings) -> str:
    """On a worker: the device of ``with_device``; not in the event loop, which sends heartbeats."""
    loop = asyncio.get_running_loop()
    decided: Any = await loop.run_in_executor(None, with_device, scan, settings)
    return str(decided.device)
