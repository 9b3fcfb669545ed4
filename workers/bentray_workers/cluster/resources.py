"""Dask resources of workers, so that rendering never queues behind reconstructions."""

from __future__ import annotations

# Every worker has one of each; with two threads, rendering starts at once beside a full queue.
RECONSTRUCTION = {"recon": 1}
RENDER = {"render": 1}
# Only where a device passed its self-test; OpenCL runs one task per process.
OPENCL = {"opencl": 1}
# Memory of that device, MiB; no task requests it, plans read it.
OPENCL_MIB = "opencl_mib"
OFFERED = {**RECONSTRUCTION, **RENDER}

THREADS = 2
