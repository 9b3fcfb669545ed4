"""Workers of this machine that join a scheduler elsewhere, again when it comes back or when they are lost."""

from __future__ import annotations

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
from .supervision import FIRST_PAUSE_S, LONGEST_PAUSE_S, LOOK_S, Losses

# What Dask loads into each worker before it joins.
PRELOADS = [PRELOAD, heartbeat.__name__]
# How long a worker may take to compile its kernels and to join, s.
START_S = 600
# How long workers may take to hand over their results when they are told to stop, s.
STOP_S = 20.0
# Between two looks for a scheduler that has gone, s.
AGAIN_S = 2.0


@dataclass(frozen=True)
class Joining:
    """What joins where.

    Attributes:
        scheduler: as ``tcp://host:port``, or ``tls://host:port`` with certificates.
        workers: processes, each with ``THREADS`` threads and one of each lane.
        lanes: what each offers, as ``cluster.resources.OFFERED``.
        memory_limit: of each, as Dask takes it: ``4GiB``, ``0`` for none; None: its share of this machine's.
        local_directory: for scratch files; None: where Dask puts them.
        host: the address that others reach this machine by; None: the one that leads to the scheduler.
        name: of a single worker; several get ``-0``, ``-1`` and so on after it. None: its address.
        security: see ``cluster.tls.security_of``.
    """

    scheduler: str
    workers: int
    lanes: Mapping[str, float]
    memory_limit: str | None
    local_directory: Path | None
    host: str | None
    name: str | None
    security: Security


def join(asked: Joining, say: Callable[[str], None], connect_timeout_s: float = 10.0) -> None:
    """Work for a scheduler until SIGTERM, SIGHUP or Ctrl-C; when it goes, wait for it to come back.

    Args:
        asked: what joins where.
        say: told in one line what has changed.
        connect_timeout_s: how long to try the address at first, s.

    Raises:
        InvalidInput: when no scheduler answers at first.
    """
    identity_of(asked.scheduler, asked.security, connect_timeout_s)
    with ours():
        asyncio.run(_serve(asked, say))


async def _serve(asked: Joining, say: Callable[[str], None]) -> None:
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        loop.add_signal_handler(number, stop.set)
    stopped = asyncio.create_task(stop.wait())
    while not stop.is_set():
        nannies = [_nanny(asked, number) for number in range(asked.workers)]
        working = asyncio.create_task(_work(asked, nannies, say))
        await asyncio.wait([working, stopped], return_when=asyncio.FIRST_COMPLETED)
        working.cancel()
        try:
            await working
        except asyncio.CancelledError:
            pass
        except (OSError, TimeoutError, RuntimeError) as error:
            # Dask wraps in the last whatever keeps a nanny from starting, as a scheduler that goes meanwhile.
            say(f"could not join {asked.scheduler}: {error}")
        finally:
            await _close(nannies)
        if not stop.is_set():
            say(f"{asked.scheduler} is gone; trying again.")
            await asyncio.wait([stopped], timeout=AGAIN_S)


async def _work(asked: Joining, nannies: list[Any], say: Callable[[str], None]) -> None:
    """Start the workers and replace those that are lost, in the list too; ends once the scheduler is gone."""
    await asyncio.gather(*nannies)
    scheduler = await _scheduler(asked)
    say(f"{asked.workers} workers joined {asked.scheduler}; Ctrl-C stops them.")
    losses, pause = Losses(), FIRST_PAUSE_S
    while True:
        await asyncio.sleep(LOOK_S)
        lost = [number for number, nanny in enumerate(nannies) if losses.lost(nanny)]
        if not lost:
            pause = FIRST_PAUSE_S
            continue
        # A worker that loses its scheduler ends; so do all of them, and there is nothing to replace them for.
        if scheduler is None or await _scheduler(asked) != scheduler:
            return
        say(f"{len(lost)} of {asked.workers} workers are lost; starting others.")
        await _close([nannies[number] for number in lost])
        for number in lost:
            nannies[number] = _nanny(asked, number)
        begun = await asyncio.gather(*(nannies[number] for number in lost), return_exceptions=True)
        if any(isinstance(one, Exception) for one in begun):
            say(f"not all of them could be started; trying again in {pause:g} s.")
            await asyncio.sleep(pause)
            pause = min(2.0 * pause, LONGEST_PAUSE_S)


async def _scheduler(asked: Joining) -> str | None:
    """What tells the scheduler from the next one at its address; None where there is none."""
    with suppress(*NO_SCHEDULER):
        return str((await identity(asked.scheduler, asked.security, AGAIN_S, 0))["id"])
    return None


def _nanny(asked: Joining, number: int) -> Any:
    name = asked.name if asked.name is None or asked.workers == 1 else f"{asked.name}-{number}"
    return Nanny(
        asked.scheduler,
        nthreads=THREADS,
        resources=dict(asked.lanes),
        # Dask takes a number up to 1 as a part of what the machine, or the container, has.
        memory_limit=asked.memory_limit if asked.memory_limit is not None else 1.0 / asked.workers,
        local_directory=None if asked.local_directory is None else str(asked.local_directory),
        # Dask would listen on every interface; whoever reaches a worker can run code on it.
        host=asked.host or own_address(asked.scheduler),
        name=name,
        security=asked.security,
        preload=PRELOADS,
        dashboard=False,
        dashboard_address=NO_DASHBOARD,
        # One process that cannot join must not wait for ever: all of them try again together.
        death_timeout=START_S,
        silence_logs=logging.WARNING,
    )


def own_address(scheduler: str) -> str:
    """The address of this machine that the scheduler sees: that of the interface which leads to it."""
    host, port = parse_host_port(scheduler.partition("://")[2])
    family, kind, _, _, there = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    # Connecting sends nothing; it only asks for the way.
    with socket.socket(family, kind) as way:
        way.connect(there)
        return str(way.getsockname()[0])


async def _close(nannies: list[Any]) -> None:
    """End the workers; one that does not stop in time is killed by its nanny."""
    closing = [nanny.close(timeout=STOP_S, reason="bentray-worker-stops") for nanny in nannies]
    await asyncio.gather(*closing, return_exceptions=True)
