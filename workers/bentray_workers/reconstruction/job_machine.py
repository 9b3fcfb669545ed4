"""The workers of a job: their device and its blocks, decided at its start and kept when it is resumed."""

import asyncio
import json
from pathlib import Path
from typing import Any

from distributed import Client, LocalCluster
from distributed.system import MEMORY_LIMIT

from bentray_kernels.acquisition import Dataset
from bentray_kernels.errors import InvalidInput
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.device_choice import ScanSize, choose_device, device_work, needs_decision

from ..cluster.capacities import WorkerCapacity, capacities_by_address, capacities_of, resources_for
from ..cluster.resources import RECONSTRUCTION
from ..files.atomic import write_bytes
from ..files.dataset.counts import DatasetCounts
from .blocks.block_choice import fitting_blocks

# In the folder of the job: by name, the value and why.
DECISIONS = "decisions.json"


class JobMachine:
    """See ``settled.Machine``.

    Args:
        client: of a cluster; None: threads of this process, whose limit is the memory of this machine.
        folder: of the job.

    Attributes:
        placement: of the tasks of the job.
    """

    def __init__(self, client: Client | None, folder: Path) -> None:
        self._client, self._file = client, folder / DECISIONS
        self.placement: dict[str, Any] = {"resources": RECONSTRUCTION}

    def place(self, settings: Settings) -> None:
        """Place the tasks on workers that offer what the settings need.

        Raises:
            InvalidInput: for a device that no worker offers.
        """
        if self._client is not None:
            self.placement = {"resources": resources_for(self._client, settings)}

    def device(self, size: ScanSize, settings: Settings) -> tuple[str, str]:
        """The device that all tasks use, so that the bits of a job are of one device; and why.

        Raises:
            InvalidInput: for a device that is requested, and of which there is none.
        """
        # Workers of a cluster are asked for a device that is requested when the tasks are placed.
        if self._client is None and settings.device != "auto":
            return choose_device(size, settings)
        if settings.device != "auto" or not self._may_decide(settings) or device_work(size, settings) is None:
            return settings.device, ""
        kept = self._kept("device", ("auto", "opencl"))
        if kept is None or not self._offered(settings.changed(device=kept[0])):
            kept = choose_device(size, settings) if self._client is None else self._on_workers(size, settings)
            self._keep("device", kept)
        return kept

    def blocks(self, dataset: Dataset, settings: Settings) -> tuple[int, str]:
        """The fewest blocks of a volume whose tasks fit a worker, and why."""
        fixed = settings.numerics.blocks
        if settings.method != "sart" or settings.decomposition == "slices" or fixed > 1:
            return fixed, ""
        kept = self._kept("blocks", range(1, settings.grid_nodes))
        if kept is None:
            here = (WorkerCapacity(int(MEMORY_LIMIT), ("recon",)),)
            scan = DatasetCounts.from_dataset(dataset).summary(settings)
            workers = here if self._client is None else capacities_of(self._client)
            count = fitting_blocks(scan, settings, workers)
            kept = count, "since the arrays of the whole volume fit no worker" if count > 1 else ""
            self._keep("blocks", kept)
        return kept

    def _may_decide(self, settings: Settings) -> bool:
        """Whether a worker may have a device for ``auto``; embedded ones have those of this machine."""
        if self._client is None or isinstance(self._client.cluster, LocalCluster):
            return needs_decision(settings)
        offered = any("opencl" in worker.resources for worker in capacities_of(self._client))
        return offered and (settings.method != "gauss-newton" or settings.reflection.enabled)

    def _offered(self, settings: Settings) -> bool:
        try:
            return self._client is None or bool(resources_for(self._client, settings))
        except InvalidInput:
            return False

    def _on_workers(self, size: ScanSize, settings: Settings) -> tuple[str, str]:
        """On those that have a device; embedded ones have not tested theirs yet."""
        assert self._client is not None
        local = isinstance(self._client.cluster, LocalCluster)
        able = [
            address
            for address, worker in capacities_by_address(self._client).items()
            if local or "opencl" in worker.resources
        ]
        if not able:
            return settings.device, "no worker has an OpenCL device"
        asked = able[:1] if local else able
        answers = list(self._client.run(device_here, size, settings, workers=asked).values())
        slower = next((answer for answer in answers if answer[0] != "opencl"), None)
        if slower is not None or not self._offered(settings.changed(device="opencl")):
            return settings.device, slower[1] if slower else "no worker offers its OpenCL device any more"
        return answers[0][0], answers[0][1]

    def _stored(self) -> dict[str, Any]:
        try:
            return dict(json.loads(self._file.read_text()))
        except (OSError, ValueError, TypeError):
            return {}

    def _kept(self, name: str, values: Any) -> tuple[Any, str] | None:
        """The decision of an earlier run; None without one, and for one that is damaged."""
        match self._stored().get(name):
            case [value, str(why)] if value in values:
                return value, why
        return None

    def _keep(self, name: str, decision: tuple[Any, str]) -> None:
        self._file.parent.mkdir(parents=True, exist_ok=True)
        write_bytes(self._file, json.dumps({**self._stored(), name: decision}).encode())


async def device_here(size: ScanSize, settings: Settings) -> tuple[str, str]:
    """On a worker: ``choose_device``; not in the event loop, which sends heartbeats."""
    loop = asyncio.get_running_loop()
    return await loop.run_in_executor(None, choose_device, size, settings)
