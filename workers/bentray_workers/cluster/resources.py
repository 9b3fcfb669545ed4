"""Dask resources of workers, so that rendering never queues behind reconstructions."""

from __future__ import annotations

# Every worker has one of each; with two threads, rendering starts at once beside a full queue.
RECONSTRUCTION = {"recon": 1}
RENDER = {"render": 1}
# Only where a device passed its self-test; OpenCL runs one task per process.
OPENCL = {"opencl": 1}
OFFERED = {**RECONSTRUCTION, **RENDER}

THREADS = 2
