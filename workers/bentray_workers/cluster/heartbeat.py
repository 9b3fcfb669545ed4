"""The sign of life of a worker that joined a scheduler: a file that is fresh while it serves there.

A preload module of Dask; a health check reads the file, so Dask is imported where a worker starts.
"""

from __future__ import annotations

import fcntl
import os
import re
import tempfile
import time
from pathlib import Path
from typing import Any

# Between two signs, s.
BEAT_S = 5.0
# A worker whose last sign is older has lost its scheduler or hangs, s.
STALE_S = 30.0


def file_for(scheduler: str) -> Path:
    """What the workers of this user touch that serve the scheduler at an address, as ``tcp://head:8786``."""
    name = re.sub(r"\W+", "-", scheduler)
    return Path(tempfile.gettempdir()) / f"bentray-worker-{os.getuid()}-{name}.alive"


def silence_s(scheduler: str) -> float | None:
    """Time since the last sign of life, s; None where there was none, or who gave it is gone."""
    try:
        with file_for(scheduler).open("rb") as file:
            try:
                # A worker that was killed leaves a file that is fresh for a while, but not its lock.
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                return max(time.time() - os.fstat(file.fileno()).st_mtime, 0.0)
    except FileNotFoundError:
        pass
    return None


def dask_setup(worker: Any) -> None:
    """Called by Dask before a worker joins: from then on its event loop gives the signs."""
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
