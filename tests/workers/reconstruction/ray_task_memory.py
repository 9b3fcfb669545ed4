"""Peak memory of the calls of a reconstruction, in processes of their own.

As in ``benchmarks/shared/_peak_memory.py`` each task runs in a fork of a warm process, less a fork that does
nothing; the bytes of what was there before are added: dataset, problem and arguments.
"""

from dataclasses import fields, is_dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from benchmarks.shared._peak_memory import peak

from bentray_kernels.acquisition import Dataset
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.tomography import Settings
from bentray_kernels.tomography.reconstruction_graph import ReconstructionGraph
from bentray_kernels.tomography.scan import MemorySource, Scan
from bentray_workers.reconstruction.blocks.block_graph import BlockSartGraph


def scan(elements: int, heights: int) -> Dataset:
    """Made-up smooth delays and losses of a ring, at several heights or without one."""
    every = np.arange(elements)
    angle = every * 2 * np.pi / elements
    delta = -1e-6 * np.sin(0.5 * (angle[:, None] - angle[None, :])) ** 2
    if heights:
        delta = delta * np.ones(heights)[:, None, None]
    return Dataset(
        Ring(elements, 0.08).positions(),
        every,
        every,
        1500.0,
        delta_tof_s=delta,
        log_ratio_np=-1e5 * delta,
        water_attenuation_np_m=0.1,
        slice_z_m=0.004 * np.arange(heights) if heights else None,
    )


def held(*things: Any) -> int:
    """Bytes of the arrays in records, lists and tuples."""
    found = 0
    for thing in things:
        if isinstance(thing, np.ndarray):
            found += thing.nbytes
        elif is_dataclass(thing):
            found += held(*(getattr(thing, part.name) for part in fields(thing)))
        elif isinstance(thing, list | tuple):
            found += held(*thing)
    return found


def bytes_of(dataset: Dataset, settings: Settings) -> dict[str, int]:
    """The most that a task of each name takes, over one slice or the volume."""
    scan = Scan(MemorySource(dataset), settings)
    with TemporaryDirectory() as folder:
        blocks = settings.numerics.blocks > 1
        graph = BlockSartGraph(scan, 0, Path(folder) / "blocks") if blocks else ReconstructionGraph(scan, 0)
        # Tasks of blocks read files alone; a problem keeps what its tasks have computed.
        kept = () if blocks else (dataset, scan.problem(0))
        found: dict[tuple[str, int], int] = {}
        waiting = graph.first()
        # All emitters take the same in blocks.
        while waiting and not (blocks and graph.done):
            task = waiting.pop(0)
            name = task.function.__name__
            number = len(graph.history)
            # Sweeps and rays of blocks differ from block to block.
            if (name, number) not in found or blocks:
                if blocks:
                    # Sweeps of small blocks do not load all compiled code.
                    task.function(*task.arguments)
                taken = peak(lambda task=task: task.function(*task.arguments)) - peak(lambda: None)
                taken += held(*kept, task.arguments[1:])
                found[name, number] = max(taken, found.get((name, number), 0))
            waiting = graph.after(task, task.function(*task.arguments)) + waiting
    return {name: max(most for (one, _), most in found.items() if one == name) for name, _ in found}


def main(settings: dict[str, Any], elements: int, heights: int) -> dict[str, int]:
    """Bytes by task; 0 heights for one slice."""
    asked = Settings.from_values(**{"method": "sart", **settings})
    # Loading compiled code takes memory too, here and not in the forks.
    small = Settings.from_values(**{"method": "sart", **settings, "nodes": 16})
    for _ in range(2):
        bytes_of(scan(8, heights and 2), small)
    return bytes_of(scan(elements, heights), asked)
