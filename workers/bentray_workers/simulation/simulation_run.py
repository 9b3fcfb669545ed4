"""Simulation of a scan: on a cluster or in this process, by the same task graph and to the same bits."""

import tempfile
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any, Unpack

from distributed import Client

from bentray_kernels.acquisition import Dataset
from bentray_kernels.tomography import Progress

from ..cluster.task_pool import JobControl, run_job
from ..files.dataset import read_dataset
from .kinds import Simulated
from .parts import folder_of
from .simulation_graph import SimulationGraph


def simulate(
    settings: Simulated,
    on_progress: Callable[[Progress], None] | None = None,
    client: Client | None = None,
) -> Dataset:
    """Simulate a scan in memory.

    Args:
        settings: of a scan in a plane or a volume, by travel times or by waves.
        on_progress: called after each task.
        client: of a cluster on this machine; None: the cores of this process.
    """
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "scan.h5"
        simulate_to_file(client, settings, target, on_progress=on_progress)
        return read_dataset(target)


def simulate_to_file(
    client: Client | None,
    settings: Simulated,
    target: Path,
    work_dir: Path | None = None,
    **control: Unpack[JobControl],
) -> dict[str, Any]:
    """Simulate a scan into a dataset file.

    Args:
        client: of a cluster; None: the cores of this process.
        settings: of the scan.
        target: the file to write, whole or not at all.
        work_dir: a folder that every worker can read and write; parts that an unfinished run of the same scan
            left there are used. None: a temporary folder of this machine.
        control: see ``JobControl``.

    Returns:
        As ``assembly.write_scan``.

    Raises:
        Cancelled: when ``stop`` returned true.
        KilledWorker: for a task that kills its workers.
    """
    with nullcontext(work_dir) if work_dir else tempfile.TemporaryDirectory() as work:
        folder = folder_of(Path(work))
        folder.mkdir(exist_ok=True)
        graph = SimulationGraph(settings, folder, target)
        run_job(client, graph, Path(work), **control)
    assert graph.result is not None
    return graph.result
