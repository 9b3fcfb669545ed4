"""The sign of life of a worker that joined a scheduler: a file that is fresh while it serves there.

A preload module of Dask; a health check reads the file, so Dask is imported where a worker starts.
"""

from __future__ import annotations

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
    """Time since the last sign of life, s; None where there was none yet."""
    try:
        return max(time.time() - file_for(scheduler).stat().st_mtime, 0.0)
    except FileNotFoundError:
        return None


def dask_setup(worker: Any) -> None:
    """Called by Dask before a worker joins: from then on its event loop gives the signs."""
    from distributed.core import Status
    from tornado.ioloop import PeriodicCallback

    file = file_for(worker.scheduler.address)

    def beat() -> None:
        stream = worker.batched_stream.comm
        if worker.status == Status.running and stream is not None and not stream.closed():
            file.touch()

    worker.periodic_callbacks["bentray-heartbeat"] = PeriodicCallback(beat, 1000.0 * BEAT_S)


def dask_teardown(worker: Any) -> None:
    """Called by Dask when a worker ends in good order."""
    file_for(worker.scheduler.address).unlink(missing_ok=True)
