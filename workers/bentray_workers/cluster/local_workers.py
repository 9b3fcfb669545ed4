"""Workers of this machine for a scheduler elsewhere: they reconnect, and lost ones are replaced."""

import asyncio
import logging
import signal
import socket
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from distributed import Nanny
from distributed.comm.addressing import parse_host_port
from distributed.security import Security

from . import heartbeat
from .connection import NO_SCHEDULER, identity, identity_of
from .dask_settings import NO_DASHBOARD, ours
from .providers import PRELOAD
from .resources import THREADS
from .supervision import CHECK_S, FIRST_PAUSE_S, LONGEST_PAUSE_S, Losses

# What Dask loads into each worker before it joins.
PRELOADS = [PRELOAD, heartbeat.__name__]
# How long a worker may take to compile its kernels and to join, s.
START_S = 600
# How long workers may take to transfer their results when they stop, s.
STOP_S = 20.0
# Between two attempts to reach a scheduler, s.
AGAIN_S = 2.0


@dataclass(frozen=True)
class JoinRequest:
    """Workers to start, and the scheduler that they join.

    Attributes:
        scheduler: as ``tcp://host:port``, or ``tls://host:port`` with certificates.
        workers: processes with ``THREADS`` threads each.
        resources: of each, as ``cluster.resources.OFFERED``.
        memory_limit: of each, as ``4GiB``, ``0`` for none; None: an equal part of the memory of this machine.
        local_directory: for scratch files; None: the default of Dask.
        host: address of this machine for others; None: that of the interface to the scheduler.
        name: of a single worker; several get ``-0``, ``-1`` and so on after it. None: its address.
        security: see ``cluster.tls.security_of``.
    """

    scheduler: str
    workers: int
    resources: Mapping[str, float]
    memory_limit: str | None
    local_directory: Path | None
    host: str | None
    name: str | None
    security: Security


def join(request: JoinRequest, say: Callable[[str], None], connect_timeout_s: float = 10.0) -> None:
    """Run workers for a scheduler until SIGTERM, SIGHUP or Ctrl-C; reconnect when it returns.

    Args:
        request: the workers and the scheduler.
        say: called with a line about each change.
        connect_timeout_s: how long to try the address at first, s.

    Raises:
        InvalidInput: when no scheduler answers at first.
    """
    identity_of(request.scheduler, request.security, connect_timeout_s)
    with ours():
        asyncio.run(_serve(request, say))


async def _serve(request: JoinRequest, say: Callable[[str], None]) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        loop.add_signal_handler(number, stop.set)
    stopped = asyncio.create_task(stop.wait())
    while not stop.is_set():
        nannies = [_nanny(request, number) for number in range(request.workers)]
        working = asyncio.create_task(_work(request, nannies, say))
        await asyncio.wait([working, stopped], return_when=asyncio.FIRST_COMPLETED)
        working.cancel()
        try:
            await working
        except asyncio.CancelledError:
            pass
        except (OSError, TimeoutError, RuntimeError) as error:
            # Dask raises the last for any failed start of a nanny, as when the scheduler stops meanwhile.
            say(f"could not join {request.scheduler}: {error}")
        finally:
            await _close(nannies)
        if not stop.is_set():
            say(f"{request.scheduler} is gone; trying again.")
            await asyncio.wait([stopped], timeout=AGAIN_S)


async def _work(request: JoinRequest, nannies: list[Any], say: Callable[[str], None]) -> None:
    """Start the workers and replace lost ones, in the list too; returns once the scheduler is gone."""
    await asyncio.gather(*nannies)
    scheduler = await _scheduler(request)
    say(f"{request.workers} workers joined {request.scheduler}; Ctrl-C stops them.")
    losses, pause = Losses(), FIRST_PAUSE_S
    while True:
        await asyncio.sleep(CHECK_S)
        lost = [number for number, nanny in enumerate(nannies) if losses.lost(nanny)]
        if not lost:
            pause = FIRST_PAUSE_S
            continue
        # Workers that lose their scheduler end; they are not replaced.
        if scheduler is None or await _scheduler(request) != scheduler:
            return
        say(f"{len(lost)} of {request.workers} workers are lost; starting others.")
        await _close([nannies[number] for number in lost])
        for number in lost:
            nannies[number] = _nanny(request, number)
        begun = await asyncio.gather(*(nannies[number] for number in lost), return_exceptions=True)
        if any(isinstance(worker, Exception) for worker in begun):
            say(f"not all of them could be started; trying again in {pause:g} s.")
            await asyncio.sleep(pause)
            pause = min(2.0 * pause, LONGEST_PAUSE_S)


async def _scheduler(request: JoinRequest) -> str | None:
    """Identity of the scheduler at the address; None without one."""
    with suppress(*NO_SCHEDULER):
        return str((await identity(request.scheduler, request.security, AGAIN_S, 0))["id"])
    return None


def _nanny(request: JoinRequest, number: int) -> Any:
    name = request.name if request.name is None or request.workers == 1 else f"{request.name}-{number}"
    return Nanny(
        request.scheduler,
        nthreads=THREADS,
        resources=dict(request.resources),
        # Dask takes a number up to 1 as a part of the memory of the machine or container.
        memory_limit=request.memory_limit if request.memory_limit is not None else 1.0 / request.workers,
        local_directory=None if request.local_directory is None else str(request.local_directory),
        # Dask would listen on every interface; anyone who reaches a worker can run code on it.
        host=request.host or own_address(request.scheduler),
        name=name,
        security=request.security,
        preload=PRELOADS,
        dashboard=False,
        dashboard_address=NO_DASHBOARD,
        # A process that cannot join must not wait for ever: all of them try again together.
        death_timeout=START_S,
        silence_logs=logging.WARNING,
    )


def own_address(scheduler: str) -> str:
    """Address of this machine on the interface to the scheduler."""
    host, port = parse_host_port(scheduler.partition("://")[2])
    family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    # Connecting a datagram socket sends nothing; it only selects the route.
    with socket.socket(family, kind) as route:
        route.connect(address)
        return str(route.getsockname()[0])


async def _close(nannies: list[Any]) -> None:
    """Stop the workers; one that does not stop in time is killed by its nanny."""
    closing = [nanny.close(timeout=STOP_S, reason="bentray-worker-stops") for nanny in nannies]
    await asyncio.gather(*closing, return_exceptions=True)
