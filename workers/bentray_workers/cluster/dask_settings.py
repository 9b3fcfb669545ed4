"""The settings of Dask that every scheduler, worker and client of ours runs under."""

from __future__ import annotations

import copy

import dask

# What Dask keeps of what is over, for developers of Dask. Each stream to a worker or from a client would keep
# its last thousand messages, with arguments of up to a megabyte each, and each process an hour of its load.
LOGS = {
    "distributed.admin.low-level-log-length": 0,
    "distributed.admin.system-monitor.log-length": 1,
}

SETTINGS = {
    **LOGS,
    # What a scheduler would keep for ever, and no setting bounds.
    "distributed.scheduler.preload": ["bentray_workers.cluster.scheduler_history"],
    # A queue without workers fails its tasks after this long instead of waiting for ever.
    "distributed.scheduler.no-workers-timeout": "60s",
    # Workers that a task may kill besides the one that gives it up: each takes seconds to come back.
    "distributed.scheduler.allowed-failures": 1,
    # Dask's sampling profiler wakes every process a hundred times a second, work or no work.
    "distributed.worker.profile.enabled": False,
    # Dask lets workers hand back every 64 KiB they free, and glibc then maps each array above 128 KiB anew:
    # page faults took nearly half of a straight-ray reconstruction. These are glibc's own limits, in bytes.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 2**28,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 2**25,
    # Dask starts a web server in every process and has no way to ask who calls: it is given no pages.
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}

# The settings of a process that has a client, and perhaps a cluster of its own.
OF_CLIENTS = {
    **LOGS,
    # A step of a refinement takes the images of many steps before it, and Dask would warn from 10 MB on.
    "distributed.admin.large-graph-warning-threshold": "100MB",
    # A worker may be away for this long before its nanny is ended: compiling its kernels takes minutes. Dask
    # allows 15 s, in which a worker that is killed while it starts does not return.
    "distributed.deploy.lost-worker-timeout": "600s",
}

# Where that web server listens, since it cannot be left out: a free port of loopback.
NO_DASHBOARD = "127.0.0.1:0"


def ours() -> dask.config.set:
    """A context under our settings. Each has its own copy: a scheduler adds pages to the list it is given."""
    return dask.config.set(copy.deepcopy(SETTINGS))
