"""Measured tasks of one slice: number, CPU time and bytes."""

import pickle
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from distributed.protocol.pickle import dumps

from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.reconstruction import run_reconstruction
from bentray_kernels.tomography.reconstruction_graph import TomographyGraph
from bentray_kernels.tomography.settled import settled
from bentray_workers.files.dataset import write_dataset
from bentray_workers.reconstruction.file_scan import FileSource
from bentray_workers.simulation.plane import SimulationSettings
from bentray_workers.simulation.simulation_run import simulate


@dataclass(frozen=True)
class Work:
    """The tasks of one slice.

    Attributes:
        tasks: their number.
        seconds: CPU time, mean of a task.
        sent: bytes to a worker, mean of a task.
        returned: bytes from a worker, mean of a task.
    """

    tasks: int
    seconds: float
    sent: float
    returned: float


def of_a_slice(nodes: int, elements: int, sweeps: int) -> Work:
    """Reconstruct one slice of the 2-D phantom in this process, task by task as on a cluster."""
    seconds: list[float] = []
    sent: list[int] = []
    returned: list[int] = []

    def run_graphs(graphs: Sequence[TomographyGraph], before: int, after: int) -> None:
        for graph in graphs:
            ready = list(graph.first())
            while ready:
                task = ready.pop(0)
                sent.append(len(dumps((task.function, task.arguments))))
                started = time.thread_time()
                result = task.function(*task.arguments)
                seconds.append(time.thread_time() - started)
                returned.append(len(pickle.dumps(result, protocol=5)))
                ready = [*graph.after(task, result), *ready]

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "slice.h5"
        write_dataset(path, simulate(SimulationSettings(nodes=nodes, elements=elements)))
        stamp = path.stat().st_mtime_ns
        settings = Settings(method="sart", nodes=nodes, iterations=sweeps)
        # A few nodes, to compile and read.
        for asked in (replace(settings, nodes=16, iterations=1), settings):
            seconds.clear(), sent.clear(), returned.clear()
            source = FileSource(path, stamp, path, stamp, path)
            run_reconstruction(source, settled(source, asked), run_graphs)
    return Work(len(seconds), *(float(np.mean(column)) for column in (seconds, sent, returned)))
