"""Dask resources of workers, the lanes of tasks: pictures and short jobs never queue behind long tasks."""

from types import MappingProxyType

# Every worker has one of each, and a thread for each: a task begins beside those of the other lanes at once,
# and the system divides the cores, see ``background``. An empty lane costs nothing.
RECONSTRUCTION = {"recon": 1}
# Of jobs that draw or prepare drawing: turntables and geometry fields.
DRAWING = {"drawing": 1}
# Of pictures, and whatever else a person waits for at the page.
RENDER = {"render": 1}
# Of jobs that are planned to be short, whoever has long ones; see ``short_lane``.
SHORT = {"short": 1}
# Only where a device passed its self-test; OpenCL runs one task per process.
OPENCL = {"opencl": 1}
# Memory of that device, MiB; no task requests it, plans read it.
OPENCL_MIB = "opencl_mib"
OFFERED = {**RECONSTRUCTION, **DRAWING, **RENDER, **SHORT}

# Dask priorities of the lanes, higher ones first. A worker looks at its next task alone, and starts no other
# while the lane of this one is busy: short tasks must not be behind long ones of another lane.
PRIORITIES = MappingProxyType({"recon": 0, "drawing": 2, "short": 4})
# Above all of them: who looks at a picture waits for it.
PICTURE_PRIORITY = 10

THREADS = len(OFFERED)
# Cores for which a worker is given memory, and for which batch systems are asked: one of them draws.
CORES = 2
