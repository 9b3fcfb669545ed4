"""Heartbeat file of a worker that joined a scheduler, for health checks.

A preload module of Dask; the health check must not load Dask, so it is imported in a worker only.
"""

import fcntl
import os
import re
import tempfile
import time
from pathlib import Path
from typing import Any

# Between two heartbeats, s.
BEAT_S = 5.0
# A worker with an older heartbeat has lost its scheduler or hangs, s.
STALE_S = 30.0


def file_for(scheduler: str) -> Path:
    """The heartbeat file of workers of this user at a scheduler address, as ``tcp://head:8786``."""
    name = re.sub(r"\W+", "-", scheduler)
    return Path(tempfile.gettempdir()) / f"bentray-worker-{os.getuid()}-{name}.alive"


def seconds_since_heartbeat(scheduler: str) -> float | None:
    """Time since the last heartbeat, s; None without one, or if its worker is gone."""
    try:
        with file_for(scheduler).open("rb") as file:
            try:
                # A killed worker leaves a recent file, but its lock is released.
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return max(time.time() - os.fstat(file.fileno()).st_mtime, 0.0)
    except FileNotFoundError:
        pass
    return None


def dask_setup(worker: Any) -> None:
    """Called by Dask before a worker joins: its event loop then writes the heartbeats."""
    from distributed.core import Status
    from tornado.ioloop import PeriodicCallback

    # Open as long as the process lives.
    file = file_for(worker.scheduler.address).open("ab")
    fcntl.flock(file, fcntl.LOCK_SH)
    os.utime(file.fileno(), (0.0, 0.0))

    def beat() -> None:
        stream = worker.batched_stream.comm
        if worker.status == Status.running and stream is not None and not stream.closed():
            os.utime(file.fileno())

    worker.periodic_callbacks["bentray-heartbeat"] = PeriodicCallback(beat, 1000.0 * BEAT_S)
