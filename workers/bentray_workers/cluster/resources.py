"""The resource lanes of a worker: what a task asks for so that renders never queue behind reconstructions."""

from __future__ import annotations

# Every worker offers one of each; with two threads a render starts at once beside a full queue.
RECONSTRUCTION = {"recon": 1}
RENDER = {"render": 1}
# Only where a device passed its trial; OpenCL runs one task a process.
OPENCL = {"opencl": 1}
OFFERED = {**RECONSTRUCTION, **RENDER}

THREADS = 2
