"""Worker preload: limits, log lines and metrics of a worker, and the modules of all tasks.

Kernels are compiled, or loaded from the cache, when a task first calls them. Workers of one machine do not
compile the same kernel twice, see ``compile_events``.
"""

import os
from typing import Any

from bentray_kernels.compilation.compiled import compilation

from ..cluster import memory_cache, refusal_log
from ..cluster.worker_health import COMPILING

# Loaded before the worker joins: the first task of each kind would load them otherwise.
from ..reconstruction import quality_report, reconstruction_run  # noqa: F401
from ..rendering import field_picture, geometry_field, refraction  # noqa: F401
from ..simulation import simulation_run  # noqa: F401
from . import cache_misses


def dask_setup(worker: Any) -> None:
    """Called by Dask in each worker that preloads this module."""
    refusal_log.install()
    cache_misses.announce(counts=True)
    worker.metrics[COMPILING] = lambda _: list(compilation())
    if worker.nanny is not None:
        # A separate process: its files are readable by its user only.
        os.umask(0o077)
        memory_cache.set_memory_limit(int(worker.memory_manager.memory_limit or 0))
