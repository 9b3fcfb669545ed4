"""Where the workers are: a local cluster of processes, or one that is already running."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path
from types import TracebackType
from typing import Any

import dask
from distributed import Client, LocalCluster
from distributed.core import rpc
from distributed.security import Security

from bentray_kernels.errors import InvalidInput

from .lanes import OFFERED, THREADS

PRELOAD = "bentray_workers.warmup"

EMBEDDED = {
    # A queue without workers fails its tasks after this long instead of waiting for ever.
    "distributed.scheduler.no-workers-timeout": "60s",
    # Dask's sampling profiler wakes every process a hundred times a second, work or no work.
    "distributed.worker.profile.enabled": False,
    # Dask lets workers hand back every 64 KiB they free, and glibc then maps each array above 128 KiB anew:
    # page faults took nearly half of a straight-ray reconstruction. These are glibc's own limits, in bytes.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 2**28,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 2**25,
}

# What tells that nothing, or something else, is at an address; other protocols look like huge messages.
NO_SCHEDULER = (OSError, TimeoutError, ValueError, MemoryError)


class Cluster:
    """A client of a running scheduler, and the scheduler itself where it is ours.

    Attributes:
        client: ``distributed.Client``; tasks name their lane by ``resources=``.
    """

    def __init__(self, client: Client, local: LocalCluster | None = None) -> None:
        self.client = client
        self._local = local

    def describe(self) -> dict[str, Any]:
        """What there is now: scheduler address, workers, threads and the lanes offered."""
        workers = self.client.scheduler_info(n_workers=-1)["workers"].values()
        lanes: dict[str, float] = {}
        for worker in workers:
            for lane, amount in worker.get("resources", {}).items():
                lanes[lane] = lanes.get(lane, 0) + amount
        return {
            "scheduler": self.client.scheduler.address,
            "embedded": self._local is not None,
            "workers": len(workers),
            "threads": sum(worker["nthreads"] for worker in workers),
            "lanes": lanes,
        }

    def close(self) -> None:
        """Leave; an embedded cluster ends with it."""
        self.client.close()
        if self._local is not None:
            self._local.close()

    def __enter__(self) -> Cluster:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def open_cluster(
    scheduler_address: str | None = None,
    workers: int | None = None,
    local_directory: Path | None = None,
    *,
    processes: bool = True,
    connect_timeout_s: float = 10.0,
) -> Cluster:
    """A cluster by its scheduler's address, or an embedded one on this machine.

    Args:
        scheduler_address: as ``tcp://host:port``; None starts an embedded cluster.
        workers: worker processes of an embedded cluster; None: one a core.
        local_directory: where embedded workers keep their scratch files.
        processes: False keeps embedded workers in this process (for tests).
        connect_timeout_s: how long to try an address, s.

    Raises:
        InvalidInput: when no scheduler answers at the address, or ``workers`` is not positive.
    """
    if scheduler_address is not None:
        try:
            asyncio.run(_answers(scheduler_address, connect_timeout_s))
            return Cluster(Client(scheduler_address, timeout=connect_timeout_s, set_as_default=False))
        except NO_SCHEDULER as error:
            reason = f"no answer in {connect_timeout_s:g} s" if isinstance(error, TimeoutError) else error
            raise InvalidInput(
                "scheduler_address",
                f"{scheduler_address} ({reason})",
                "the address of a running Dask scheduler",
            ) from error
    count = workers if workers is not None else len(os.sched_getaffinity(0))
    if count < 1:
        raise InvalidInput("workers", workers, "at least 1")
    with dask.config.set(EMBEDDED):
        local = LocalCluster(
            n_workers=count,
            threads_per_worker=THREADS,
            processes=processes,
            resources=OFFERED,
            dashboard_address="127.0.0.1:0",
            preload=PRELOAD,
            local_directory=None if local_directory is None else str(local_directory),
        )
    return Cluster(Client(local, set_as_default=False), local)


async def _answers(address: str, timeout_s: float) -> None:
    """Ask the scheduler who it is. A ``Client`` would wait for ever for one that accepts and stays silent."""
    async with asyncio.timeout(timeout_s):
        secrets = Security().get_connection_args("client")
        async with rpc(address, connection_args=secrets, timeout=timeout_s) as scheduler:
            await scheduler.identity(n_workers=0)
