"""Settings of Dask for all our schedulers, workers and clients."""

import copy

import dask

# Logs for developers of Dask. Each stream to a worker or from a client would keep its last thousand messages,
# with arguments of up to a megabyte each, and each process an hour of its load.
LOGS = {
    "distributed.admin.low-level-log-length": 0,
    "distributed.admin.system-monitor.log-length": 1,
}

SETTINGS = {
    **LOGS,
    # History that a scheduler would keep for ever, and that no setting bounds.
    "distributed.scheduler.preload": ["bentray_workers.cluster.scheduler_history"],
    # Without workers, queued tasks fail after this long instead of waiting for ever.
    "distributed.scheduler.no-workers-timeout": "60s",
    # Deaths of workers after which a task is still retried: each worker takes seconds to return.
    "distributed.scheduler.allowed-failures": 1,
    # The sampling profiler of Dask wakes every process a hundred times a second, also when idle.
    "distributed.worker.profile.enabled": False,
    # Dask makes workers return every 64 KiB that they free; glibc then maps arrays above 128 KiB anew, and
    # page faults took nearly half of a straight-ray reconstruction. These are the limits of glibc, in bytes.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 2**28,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 2**25,
    # With one heap for each thread, states that the event loop had received or sent stayed in its heap when
    # they were freed: up to 34 MiB beyond the tasks of SART with 384 elements and 256² nodes.
    "distributed.nanny.pre-spawn-environ.MALLOC_ARENA_MAX": 1,
    # Dask starts a web server without authentication in every process: it is given no pages.
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}

# Settings of a process that has a client, and perhaps an embedded cluster.
OF_CLIENTS = {
    **LOGS,
    # An update of a refinement takes images of earlier updates, and Dask would warn from 10 MB on.
    "distributed.admin.large-graph-warning-threshold": "100MB",
    # A worker may be missing for this long before its nanny is closed: compiling its kernels takes minutes.
    # With the 15 s of Dask, a worker that is killed while it starts does not return.
    "distributed.deploy.lost-worker-timeout": "600s",
}

# Address of that web server, which cannot be disabled: a free port of loopback.
NO_DASHBOARD = "127.0.0.1:0"


def ours() -> dask.config.set:
    """A context with our settings. Each has its own copy: a scheduler appends pages to its list."""
    return dask.config.set(copy.deepcopy(SETTINGS))
