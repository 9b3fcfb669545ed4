"""Client of a cluster that is running, or that a provider starts."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import dask
from distributed import Client
from distributed.core import rpc
from distributed.security import Security

from bentray_kernels.errors import InvalidInput

from .connected import connected_workers
from .dask_settings import OF_CLIENTS
from .providers import ClusterRequest, DeployedCluster, deploy
from .tls import security_of

# Errors without a scheduler at an address; other protocols look like huge messages.
NO_SCHEDULER = (OSError, TimeoutError, ValueError, MemoryError)


class Cluster:
    """A client of a running scheduler, and the scheduler itself if it was started here."""

    def __init__(self, connect: Callable[[], Client], deployed: DeployedCluster | None = None) -> None:
        # For the whole process: a client reads them at each submission.
        dask.config.set(OF_CLIENTS)
        self._connect = connect
        self._deployed = deployed
        self._client = connect()
        self._changing = threading.Lock()

    @property
    def client(self) -> Client:
        """A ``distributed.Client``; tasks are submitted with ``resources=``.

        A client gives up when its scheduler is not available for longer than the time to connect. The next
        call then makes a new client, so that a restarted scheduler is found.

        Raises:
            ConnectionError: without a scheduler.
        """
        with self._changing:
            if self._client.status == "closed":
                try:
                    self._client = self._connect()
                except InvalidInput as error:
                    raise ConnectionError(str(error)) from error
            return self._client

    def describe(self) -> dict[str, Any]:
        """Scheduler address, and the present workers, threads and resources (``lanes``)."""
        client = self.client
        workers = connected_workers(client).values()
        lanes: dict[str, float] = {}
        for worker in workers:
            for lane, amount in worker.get("resources", {}).items():
                lanes[lane] = lanes.get(lane, 0) + amount
        return {
            "scheduler": client.scheduler.address,
            "embedded": self._deployed is not None,
            "workers": len(workers),
            "threads": sum(worker["nthreads"] for worker in workers),
            "lanes": lanes,
        }

    def close(self) -> None:
        """Close the client, and a cluster that was started here."""
        self._client.close()
        if self._deployed is not None:
            self._deployed.close()

    def __enter__(self) -> Cluster:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_cluster(
    scheduler_address: str | None = None,
    workers: int | None = None,
    local_directory: Path | None = None,
    *,
    kind: str = "embedded",
    template: Path | None = None,
    tls: Path | None = None,
    processes: bool = True,
    connect_timeout_s: float = 10.0,
) -> Cluster:
    """A cluster by the address of its scheduler, or a new one.

    Args:
        scheduler_address: as ``tcp://host:port``; None: start a cluster.
        workers: worker processes of a new cluster; None: the default of its kind.
        local_directory: for scratch files of embedded workers.
        kind: of a new cluster, a key of ``cluster.providers.PROVIDERS``.
        template: settings of this site for that kind.
        tls: a folder of certificates, see ``security_of``.
        processes: False keeps embedded workers in this process (for tests).
        connect_timeout_s: how long to try an address, s.

    Raises:
        InvalidInput: when no scheduler answers at the address, or from the provider.
    """
    if scheduler_address is None:
        deployed = deploy(kind, ClusterRequest(workers, local_directory, template, tls, processes))
        return Cluster(lambda: Client(deployed, set_as_default=False), deployed)
    security = security_of(tls)

    def connect() -> Client:
        # A scheduler that accepts and never answers would block a client for ever: read its identity first.
        identity_of(scheduler_address, security, connect_timeout_s)
        return Client(scheduler_address, timeout=connect_timeout_s, security=security, set_as_default=False)

    return Cluster(connect)


def identity_of(address: str, security: Security, timeout_s: float, workers: int = 0) -> dict[str, Any]:
    """Identity of the scheduler at an address, with so many of its workers, -1 for all.

    Raises:
        InvalidInput: without a scheduler, with the reason.
    """
    encrypted = address.startswith("tls://")
    if (encrypted and security.tls_ca_file is None) or (security.require_encryption and not encrypted):
        given = f"{address} with{'out' if encrypted else ''} certificates"
        raise InvalidInput(
            "scheduler_address", given, "tls://host:port with certificates, else tcp://host:port"
        )
    try:
        return asyncio.run(identity(address, security, timeout_s, workers))
    except NO_SCHEDULER as error:
        reason = f"no answer in {timeout_s:g} s" if isinstance(error, TimeoutError) else error
        raise InvalidInput(
            "scheduler_address", f"{address} ({reason})", "the address of a running Dask scheduler"
        ) from error


async def identity(address: str, security: Security, timeout_s: float, workers: int) -> dict[str, Any]:
    """Like ``identity_of``, awaited; raises one of ``NO_SCHEDULER``."""
    async with asyncio.timeout(timeout_s):
        secrets = security.get_connection_args("client")
        async with rpc(address, connection_args=secrets, timeout=timeout_s) as scheduler:
            record: dict[str, Any] = await scheduler.identity(n_workers=workers)
            return record
