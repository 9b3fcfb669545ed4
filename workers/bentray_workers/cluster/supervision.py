"""Supervision of worker processes: lost ones are replaced until their number is restored."""

import asyncio
import logging
import os
import signal
import time
from contextlib import suppress
from typing import Any
from weakref import WeakSet

from distributed import LocalCluster
from distributed.core import Status

log = logging.getLogger("bentray.workers")

# Between two checks of the workers, s.
CHECK_S = 1.0
# A nanny restarts its worker quickly; without a process for this long it never will, s.
WITHOUT_PROCESS_S = 10.0
# Between two attempts to replace workers, s.
FIRST_PAUSE_S, LONGEST_PAUSE_S = 1.0, 60.0

OVER = (Status.closing, Status.closed, Status.failed, Status.closing_gracefully)


class Losses:
    """Detects nannies that will never have a worker again."""

    def __init__(self) -> None:
        self._without_since: dict[Any, float] = {}

    def lost(self, nanny: Any) -> bool:
        """Whether a nanny has ended, or has had no worker process for ``WITHOUT_PROCESS_S``."""
        if nanny.status in OVER:
            return True
        if nanny.status != Status.running or nanny.is_alive():
            self._without_since.pop(nanny, None)
            return False
        return time.monotonic() - self._without_since.setdefault(nanny, time.monotonic()) > WITHOUT_PROCESS_S


class SupervisedCluster(LocalCluster):  # type: ignore[misc] # Dask has no types
    """A ``LocalCluster`` of processes that starts a new worker for every one that is permanently lost.

    Dask replaces the process of a worker that dies. It does not replace a nanny that failed to start its
    worker, or that Dask closed because its worker was missing for longer than ``lost-worker-timeout``.
    """

    def __init__(self, **options: Any) -> None:
        _starting.add(self)
        try:
            super().__init__(**options)
        except BaseException:
            # Ctrl-C, perhaps. Dask would close it at the end of this process, and fail.
            self.kill_workers()
            self.status = Status.closed
            raise
        finally:
            _starting.discard(self)

    def kill_workers(self) -> None:
        """End the worker processes at once; a start that waits for them fails."""
        for nanny in tuple(getattr(self, "_created", ())):
            if nanny.process is not None and (pid := nanny.process.pid) is not None:
                with suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)

    async def _start(self) -> None:
        # Ctrl-C reaches every process of a terminal. This one ends its workers, which would print tracebacks.
        # It is blocked in this thread, and in the threads and processes that are started from it.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        await super()._start()
        self._supervisor = asyncio.create_task(self._supervise())

    async def _close(self) -> None:
        if hasattr(self, "_supervisor"):
            self._supervisor.cancel()
        await super()._close()

    async def _supervise(self) -> None:
        losses, pause = Losses(), FIRST_PAUSE_S
        # Errors of the first start are raised by the constructor of the cluster.
        while self.status != Status.running or set(self.worker_spec) - set(self.workers):
            await asyncio.sleep(CHECK_S)
        while self.status == Status.running:
            await asyncio.sleep(CHECK_S)
            for name in [name for name, nanny in self.workers.items() if losses.lost(nanny)]:
                nanny = self.workers.pop(name)
                with suppress(Exception):
                    await nanny.close()
            missing = len(set(self.worker_spec) - set(self.workers))
            if not missing:
                pause = FIRST_PAUSE_S
                continue
            log.warning("%d of %d workers are lost; starting others", missing, len(self.worker_spec))
            try:
                # A cluster that closes meanwhile waits for the start, and stops the new workers.
                await asyncio.shield(self._correct_state())
            except Exception as error:
                log.warning("no worker could be started (%s); trying again in %g s", error, pause)
                await asyncio.sleep(pause)
                pause = min(2.0 * pause, LONGEST_PAUSE_S)


# Clusters whose workers have not joined yet.
_starting: WeakSet[SupervisedCluster] = WeakSet()


def stop_starting() -> None:
    """Let clusters that are being started in other threads fail now; compiling kernels takes minutes."""
    for cluster in tuple(_starting):
        cluster.kill_workers()
