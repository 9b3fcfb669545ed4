"""Peak memory of the calls that examine and pick a scan, each in a process; see ``ray_task_memory``."""

from pathlib import Path

import numpy as np
from benchmarks.shared._peak_memory import peak
from tests.workers.reconstruction.ray_task_memory import held

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_workers.files.dataset import write_dataset
from bentray_workers.reconstruction.picking_graph import PickingFiles, PickingGraph, PickingSource

RATE_HZ, CENTRE_HZ, WATER_MPS, RADIUS_M = 8e6, 1e6, 1480.0, 0.05


def scan(elements: int, samples: int, water: bool) -> Dataset:
    """Water through water with a little noise, one emission made at a time."""
    ring = Ring(elements, RADIUS_M).positions()
    every, time = np.arange(elements), np.arange(samples) / RATE_HZ - 4e-6
    random = np.random.default_rng(0)
    traces = np.empty((elements, elements, samples), np.int16)
    for e in every:
        late = CENTRE_HZ * (time - np.linalg.norm(ring - ring[e], axis=1)[:, None] / WATER_MPS)
        pulse = np.exp(-(late**2)) * np.sin(2.0 * np.pi * late)
        traces[e] = 1000.0 * pulse + 3.0 * random.standard_normal(pulse.shape)
    return Dataset(
        ring,
        every,
        every,
        WATER_MPS,
        waveform=Waveform(traces, traces if water else None),
        center_frequency_hz=CENTRE_HZ,
        sampling_rate_hz=RATE_HZ,
        t0_s=-4e-6,
    )


def bytes_of(path: Path, picker: str) -> dict[str, int]:
    """The first task of each name, with its arguments, less a fork that does nothing."""
    graph = PickingGraph(
        PickingSource(path, path.stat().st_mtime_ns, path.parent, picker, True),
        PickingFiles.in_folder(path.parent),
    )
    waiting, found = graph.first(), {}
    while waiting:
        task = waiting.pop(0)
        name = task.function.__name__
        if name not in found:
            taken = peak(lambda task=task: task.function(*task.arguments)) - peak(lambda: None)
            found[name] = taken + held(*task.arguments)
        waiting = graph.after(task, task.function(*task.arguments)) + waiting
    return found


def main(place: str, picker: str, elements: int, samples: int, water: bool) -> dict[str, int]:
    """Bytes by task, and those of the traces; the files of scans are in the folder ``place``."""
    folder = Path(place)
    # Loading compiled code takes memory too, here and not in the forks.
    write_dataset(folder / "small.h5", scan(12 if water else 48, 700, water))
    bytes_of(folder / "small.h5", picker)
    write_dataset(folder / "scan.h5", scan(elements, samples, water))
    found = bytes_of(folder / "scan.h5", picker)
    return {**found, "traces": (4 if water else 2) * elements**2 * samples}
