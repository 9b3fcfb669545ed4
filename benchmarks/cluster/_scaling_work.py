"""What one slice is made of, measured: its tasks, the time of a core and the bytes that each takes."""

from __future__ import annotations

import pickle
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from distributed.protocol.pickle import dumps

from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.reconstruct import carried_out
from bentray_kernels.tomography.task_chains import Chain
from bentray_workers.files.dataset import read_dataset, write_dataset
from bentray_workers.reconstruction.file_scan import FileScan
from bentray_workers.simulation.plane import SimulationSettings, simulate


@dataclass(frozen=True)
class Work:
    """The tasks of one slice.

    Attributes:
        tasks: so many.
        seconds: of a core, mean of a task.
        sent: bytes to a worker, mean of a task.
        returned: bytes from a worker, mean of a task.
    """

    tasks: int
    seconds: float
    sent: float
    returned: float


def of_a_slice(nodes: int, elements: int, sweeps: int) -> Work:
    """Reconstruct one slice of Table 6 here, call by call as a cluster would be given them."""
    seconds: list[float] = []
    sent: list[int] = []
    returned: list[int] = []

    def drive(chains: Sequence[Chain], before: int, after: int) -> None:
        for chain in chains:
            ready = list(chain.first())
            while ready:
                call = ready.pop(0)
                sent.append(len(dumps((call.function, call.arguments))))
                begun = time.thread_time()
                given = call.function(*call.arguments)
                seconds.append(time.thread_time() - begun)
                returned.append(len(pickle.dumps(given, protocol=5)))
                ready = [*chain.after(call, given), *ready]

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "slice.h5"
        write_dataset(path, simulate(None, SimulationSettings(nodes=nodes, elements=elements)))
        stamp = path.stat().st_mtime_ns
        settings = Settings(nodes=nodes, sweeps=sweeps)
        # A few nodes, to compile and read.
        for asked in (replace(settings, nodes=16, sweeps=1), settings):
            seconds.clear(), sent.clear(), returned.clear()
            carried_out(
                read_dataset(path), asked, lambda plan, part: FileScan(path, stamp, plan, part), drive
            )
    return Work(len(seconds), *(float(np.mean(column)) for column in (seconds, sent, returned)))
